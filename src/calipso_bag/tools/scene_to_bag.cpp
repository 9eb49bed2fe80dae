#include <algorithm>
#include <cmath>
#include <iostream>

#include "calipso_bag/arguments.hpp"
#include "calipso_bag/image_source.hpp"
#include "calipso_scene/scene.hpp"
#include "ros/clip_writer.hpp"
#include "ros/guarded_main.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

constexpr char kUsage[] =
    "usage: scene_to_bag SCENE_DIR OUT.bag [--seconds S] [--compressed]\n"
    "  writes the scene's frames, camera_info and camera poses (tf) as a bag\n"
    "  --seconds S   a shorter clip is continued with its last frame (a single frame: 2 s)\n"
    "  --compressed  JPEG images";
constexpr double kStillSeconds = 2.0;

void convert(const Arguments& arguments) {
  const Scene scene = loadScene(arguments.word(0));
  const auto poses = static_cast<int>(scene.world_from_camera_per_frame.size());
  if (scene.camera_moves && poses < scene.frame_count) {
    throw std::runtime_error(scene.directory + "/scene.yaml: the camera moves, but " +
                             "world_T_camera_per_frame has " + std::to_string(poses) +
                             " poses for " + std::to_string(scene.frame_count) +
                             " frames; list one for each");
  }
  const double seconds =
      arguments.positive("seconds", scene.frame_count == 1 ? kStillSeconds : 0.0);
  const auto frames =
      holdLast(openSequence(scene.directory, scene.frame_pattern, scene.frame_count, scene.fps),
               static_cast<int>(std::lround(seconds * scene.fps)));
  ClipWriter writer(arguments.word(1), scene.camera, scene.fps, arguments.has("compressed"));
  while (const auto image = frames->next()) {
    writer.add(*image, scene.cameraAt(writer.frameCount()).world_from_camera);
  }
  writer.finish();
  std::cout << arguments.word(1) << ": " << writer.frameCount() << " frames at " << scene.fps
            << " per second\n";
}

}  // namespace

int main(int argc, char** argv) {
  return runTool([&] { convert(Arguments(argc, argv, 2, {"seconds"}, {"compressed"}, kUsage)); });
}
