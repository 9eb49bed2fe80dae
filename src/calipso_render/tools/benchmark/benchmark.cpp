#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <exception>
#include <functional>
#include <opencv2/core/utils/logger.hpp>
#include <string>
#include <vector>

#include "../picture_file.hpp"
#include "calipso_scene/help.hpp"
#include "calipso_scene/memory.hpp"
#include "drawing_case.hpp"
#include "filling_case.hpp"
#include "mesh_drawing.hpp"
#ifdef CALIPSO_HAVE_EGL
#include "llvmpipe.hpp"
#endif

namespace calipso::render {
namespace {

double wallMs() {
  return std::chrono::duration<double, std::milli>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// Of all threads.
double cpuMs() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

struct Options {
  std::string pictures;  // folder; empty: none are written
  int frames = 12;
  bool drawing = true;
  std::string only;  // one way of drawing; empty: all
  std::vector<std::string> scenes;
};

// Best and median of the frames after the first two.
void timeFrames(const std::string& name, const DrawingCase& drawing, const Options& options,
                const std::function<cv::Mat(int)>& draw) {
  std::vector<double> wall, cpu;
  cv::Mat last;
  for (int k = 0; k < options.frames + 2; ++k) {
    const double w = wallMs(), p = cpuMs();
    last = draw(k);
    if (k >= 2) wall.push_back(wallMs() - w), cpu.push_back(cpuMs() - p);
  }
  std::sort(wall.begin(), wall.end()), std::sort(cpu.begin(), cpu.end());
  if (!options.pictures.empty()) writePicture(options.pictures + "/" + name + ".png", last);
  std::printf(
      "{\"case\": \"%s\", \"triangles\": %d, \"coverage\": %.3f, \"wall_ms\": %.2f, \"cpu_ms\": "
      "%.2f, \"cpu_median_ms\": %.2f}\n",
      name.c_str(), drawing.triangles, drawing.coverage, wall.front(), cpu.front(),
      cpu[cpu.size() / 2]);
  std::fflush(stdout);
}

void timeDrawing(const Options& options) {
  const DrawingCase live = makeDrawingCase(Quality::kLive);
  const auto wanted = [&](const char* name) {
    return options.only.empty() || options.only == name;
  };
  struct Way {
    const char* name;
    Quality quality;
    bool casts_shadow;  // on the table; llvmpipe's drawing does not
  };
  for (const Way& way : {Way{"drawing_live", Quality::kLive, true},
                         Way{"drawing_live_no_cast_shadow", Quality::kLive, false},
                         Way{"drawing_final", Quality::kFinal, true}}) {
    if (!wanted(way.name)) continue;
    DrawingCase drawing = live;
    drawing.params.quality = way.quality;
    if (!way.casts_shadow) drawing.params.planes.clear();
    Renderer renderer(drawing.prepared, drawing.params);
    timeFrames(way.name, drawing, options,
               [&](int k) { return renderer.composite(drawing.input(k)).bgr; });
  }
  if (wanted("drawing_mesh_alone")) {
    const MeshDrawing mesh(live);
    timeFrames("drawing_mesh_alone", live, options,
               [&](int k) { return mesh.draw(live.verticesAt(k)); });
  }
  if (!wanted("drawing_llvmpipe")) return;
#ifdef CALIPSO_HAVE_EGL
  try {
    LlvmpipeDrawing peer(live);
    std::fprintf(stderr, "OpenGL: %s\n", peer.renderer().c_str());
    timeFrames("drawing_llvmpipe", live, options,
               [&](int k) { return peer.draw(live.verticesAt(k)); });
  } catch (const std::exception& error) {
    std::fprintf(stderr, "drawing_llvmpipe left out: %s\n", error.what());
  }
#else
  std::fprintf(stderr, "drawing_llvmpipe left out: built without EGL (libegl-dev, libgl-dev)\n");
#endif
}

void compareScene(const std::string& scene, const Options& options) {
  const auto text = [](const std::optional<double>& value) {
    return value ? std::to_string(*value) : std::string("null");
  };
  for (const FillingResult& r : compareFilling(scene, options.pictures, cpuMs)) {
    std::printf(
        "{\"case\": \"filling\", \"scene\": \"%s\", \"method\": \"%s\", \"hole\": %.3f, "
        "\"psnr_db\": %s, \"gradient_ratio\": %s, \"cpu_ms\": %.1f}\n",
        scene.c_str(), r.method.c_str(), r.hole, text(r.psnr_db).c_str(),
        text(r.gradient_ratio).c_str(), r.cpu_ms);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace calipso::render

constexpr char kUsage[] =
    "usage: benchmark [--frames N] [--pictures DIR] [--no-drawing] [--only CASE] [SCENE_DIR...]\n"
    "  CASE: drawing_live, drawing_live_no_cast_shadow, drawing_final, drawing_mesh_alone or "
    "drawing_llvmpipe\n"
    "  One line of JSON per case.\n";

int main(int argc, char** argv) {
  using namespace calipso::render;
  calipso::helpIfAsked(argc, argv, kUsage);
  cv::utils::logging::setLogLevel(
      cv::utils::logging::LOG_LEVEL_SILENT);  // masks of resting objects exist once only
  calipso::keepFreedMemory();
  Options options;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--pictures") == 0 && has_value)
      options.pictures = argv[++i];
    else if (std::strcmp(argv[i], "--frames") == 0 && has_value)
      options.frames = std::max(1, std::atoi(argv[++i]));
    else if (std::strcmp(argv[i], "--only") == 0 && has_value)
      options.only = argv[++i];
    else if (std::strcmp(argv[i], "--no-drawing") == 0)
      options.drawing = false;
    else if (std::strncmp(argv[i], "--", 2) == 0) {
      std::fprintf(stderr, "unknown option or missing value: %s\n%s", argv[i], kUsage);
      return 1;
    } else
      options.scenes.push_back(argv[i]);
  }
  try {
    makePictureFolder(options.pictures);
    if (options.drawing) timeDrawing(options);
    for (const std::string& scene : options.scenes) compareScene(scene, options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
