#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <opencv2/core/utils/logger.hpp>
#include <string>

#include "calipso_scene/help.hpp"
#include "calipso_scene/memory.hpp"
#include "evaluation.hpp"

constexpr char kUsage[] =
    "usage: evaluate [--pictures DIR] [--summaries DIR] [--sheets DIR] [--appearance-only] "
    "[--enlarge TIMES] SCENE_DIR...\n"
    "  One line of JSON per scene folder with ground truth.\n";
constexpr int kMostTimes = 8;

namespace {

// One line of JSON.
std::string toJson(const calipso::render::Figures& figures) {
  std::string json = "{\"case\": \"" + figures.name + "\"";
  for (const auto& [key, value] : figures.values) {
    char text[64] = "null";
    if (value) std::snprintf(text, sizeof(text), "%.4g", *value);
    json += ", \"" + key + "\": " + text;
  }
  return json + "}";
}

}  // namespace

int main(int argc, char** argv) {
  calipso::helpIfAsked(argc, argv, kUsage);
  cv::utils::logging::setLogLevel(
      cv::utils::logging::LOG_LEVEL_SILENT);  // masks of resting objects exist once only
  calipso::keepFreedMemory();
  calipso::render::EvaluationOptions options;
  int first = 1;
  for (; first < argc && std::strncmp(argv[first], "--", 2) == 0; ++first) {
    if (std::strcmp(argv[first], "--appearance-only") == 0)
      options.appearance_only = true;
    else if (std::strcmp(argv[first], "--pictures") == 0 && first + 1 < argc)
      options.pictures = argv[++first];
    else if (std::strcmp(argv[first], "--summaries") == 0 && first + 1 < argc)
      options.summaries = argv[++first];
    else if (std::strcmp(argv[first], "--sheets") == 0 && first + 1 < argc)
      options.sheets = argv[++first];
    else if (std::strcmp(argv[first], "--enlarge") == 0 && first + 1 < argc)
      options.enlarge = std::atoi(argv[++first]);
    else
      first = argc;
  }
  if (options.enlarge < 1 || options.enlarge > kMostTimes) {
    std::fprintf(stderr, "--enlarge: 1 to %d times\n%s", kMostTimes, kUsage);
    return 1;
  }
  if (first >= argc) {
    std::fprintf(stderr, "%s", kUsage);
    return 1;
  }
  int status = 0;
  for (int i = first; i < argc; ++i) {
    try {
      std::printf("%s\n", toJson(calipso::render::evaluateScene(argv[i], options)).c_str());
      std::fflush(stdout);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s: %s\n", argv[i], error.what());
      status = 1;
    }
  }
  return status;
}
