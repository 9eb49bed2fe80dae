#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "drawing_case.hpp"

namespace calipso::render {
namespace {


double wallMs() { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Of all threads.
double cpuMs() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

void timeDrawing(Quality quality, int frames, const char* picture) {
  const DrawingCase c = makeDrawingCase(quality);
  Renderer renderer(c.prepared, c.params);
  std::vector<double> wall, cpu;
  cv::Mat last;
  for (int k = 0; k < frames + 2; ++k) {
    const FrameInput in = c.input(k);
    const double w = wallMs(), p = cpuMs();
    const FrameOutput out = renderer.composite(in);
    if (k >= 2) wall.push_back(wallMs() - w), cpu.push_back(cpuMs() - p);
    last = out.bgr;
  }
  if (picture != nullptr) cv::imwrite(std::string(picture) + (quality == Quality::kFinal ? "/drawing_final.png" : "/drawing_live.png"), last);
  std::printf("{\"case\": \"drawing_%s\", \"triangles\": %d, \"coverage\": %.3f, \"wall_ms\": %.2f, \"cpu_ms\": %.2f}\n",
              quality == Quality::kFinal ? "final" : "live", c.triangles, c.coverage,
              *std::min_element(wall.begin(), wall.end()), *std::min_element(cpu.begin(), cpu.end()));
  std::fflush(stdout);
}

}  // namespace
}  // namespace calipso::render

// Usage: benchmark [--frames N] [--pictures DIR] [CASE...]   One line of JSON per case.
int main(int argc, char** argv) {
  using namespace calipso::render;
  const char* pictures = nullptr;
  int frames = 12;
  std::vector<std::string> cases;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--pictures") == 0 && has_value) pictures = argv[++i];
    else if (std::strcmp(argv[i], "--frames") == 0 && has_value) frames = std::max(1, std::atoi(argv[++i]));
    else cases.push_back(argv[i]);
  }
  const auto wanted = [&](const char* name) { return cases.empty() || std::count(cases.begin(), cases.end(), name) > 0; };
  if (wanted("drawing_live")) timeDrawing(Quality::kLive, frames, pictures);
  if (wanted("drawing_final")) timeDrawing(Quality::kFinal, frames, pictures);
}
