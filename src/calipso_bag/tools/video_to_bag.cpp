#include <cmath>
#include <iostream>
#include <optional>

#include "calipso_bag/arguments.hpp"
#include "calipso_bag/calibration.hpp"
#include "calipso_bag/image_source.hpp"
#include "ros/clip_writer.hpp"
#include "ros/guarded_main.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

constexpr char kUsage[] =
    "usage: video_to_bag VIDEO_OR_IMAGE OUT.bag (--fov DEG | --calibration FILE.yaml)\n"
    "                    [--seconds S] [--compressed]\n"
    "  --fov          horizontal field of view; square pixels, no distortion\n"
    "  --calibration  as written by camera_calibration; distorted images are straightened\n"
    "  --seconds S    a shorter clip is continued with its last frame (a single image: 2 s)\n"
    "  --compressed   JPEG images\n"
    "  The camera's pose comes from the scene (scene.yaml) when the bag is played.";
constexpr double kStillSeconds = 2.0;

Calibration calibrationFor(const Arguments& arguments, const cv::Mat& image) {
  if (arguments.has("fov") == arguments.has("calibration")) throw std::invalid_argument(kUsage);
  if (arguments.has("calibration")) return loadCalibration(arguments.text("calibration", ""));
  return {cameraFromFov(image.cols, image.rows, arguments.number("fov", 0.0)), {}};
}

void convert(const Arguments& arguments) {
  // A first look finds the size, and whether this is a still image.
  const auto look = openVideo(arguments.word(0));
  const auto first = look->next();
  if (!first) throw std::runtime_error(arguments.word(0) + ": holds no frame");
  const bool still = !look->next().has_value();
  const Calibration calibration = calibrationFor(arguments, *first);

  const double seconds = arguments.positive("seconds", still ? kStillSeconds : 0.0);
  const auto frames =
      holdLast(openVideo(arguments.word(0)), static_cast<int>(std::lround(seconds * look->fps())));
  ClipWriter writer(arguments.word(1), calibration.camera, look->fps(),
                    arguments.has("compressed"));
  while (const auto image = frames->next()) {
    writer.add(calibration.distorted() ? undistort(*image, calibration) : *image, std::nullopt);
  }
  writer.finish();
  std::cout << arguments.word(1) << ": " << writer.frameCount() << " frames at " << look->fps()
            << " per second\n";
  const Camera& camera = calibration.camera;
  std::cout << "for scene.yaml: width: " << camera.width << ", height: " << camera.height
            << ", fps: " << look->fps() << ", fx: " << camera.fx << ", fy: " << camera.fy
            << ", cx: " << camera.cx << ", cy: " << camera.cy << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  return runTool([&] {
    convert(Arguments(argc, argv, 2, {"fov", "calibration", "seconds"}, {"compressed"}, kUsage));
  });
}
