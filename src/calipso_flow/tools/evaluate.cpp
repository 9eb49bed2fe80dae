// Evaluates the dynamics on scene folders and the dense flow on folders with a true flow; see the
// package's README for the keys that are printed.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "dynamics_case.hpp"
#include "filmed_case.hpp"
#include "flow_case.hpp"
#include "repeat_case.hpp"

namespace {

constexpr char kUsage[] =
    "usage: evaluate [--models aligned|true|held|DIR] [--trace DIR] [--scale N] [--filmed] "
    "[--repeats N] PATH...\n"
    "  PATH      a scene folder (scene.yaml), or a folder with frame10.png, frame11.png, "
    "flow10.flo\n"
    "  --models  aligned (default): as calipso_align fits them to the key frame; true: true shape "
    "and\n"
    "            pose; held: the true shape as a fit without any depth sees it, at the rough "
    "placement's\n"
    "            distance; DIR: <object>.obj in world coordinates\n"
    "  --trace   writes one CSV file per object there: the estimate and the truth, frame by frame\n"
    "  --filmed  adds bodies simulated in a known wind or with a known stiffness, filmed by this "
    "tool\n"
    "  --repeats N noisy films of a thrown box: how often the stated intervals hold the truth\n"
    "  --scale   enlarges the frames first: 2 makes 1280x720 of 640x360\n";

}  // namespace

int main(int argc, char** argv) {
  calipso::flow::DynamicsOptions options;
  bool filmed = false;
  int repeats = 0;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--models" && i + 1 < argc) {
      options.models = argv[++i];
    } else if (argument == "--trace" && i + 1 < argc) {
      options.trace = argv[++i];
    } else if (argument == "--repeats" && i + 1 < argc) {
      repeats = std::max(0, std::atoi(argv[++i]));
    } else if (argument == "--filmed") {
      filmed = true;
    } else if (argument == "--scale" && i + 1 < argc) {
      options.scale = std::max(1, std::atoi(argv[++i]));
    } else {
      paths.push_back(argument);
    }
  }
  if (paths.empty() && !filmed && repeats == 0) {
    std::cerr << kUsage;
    return 2;
  }
  std::vector<std::string> entries;
  bool good = true;
  if (filmed) entries = calipso::flow::evaluateFilmed();
  if (repeats > 0) {
    const auto found = calipso::flow::evaluateRepeats(repeats);
    entries.insert(entries.end(), found.begin(), found.end());
  }
  for (const std::string& path : paths) {
    try {
      const bool is_flow = std::filesystem::exists(path + "/flow10.flo");
      const std::vector<std::string> found =
          is_flow ? calipso::flow::evaluateFlow(path) : calipso::flow::evaluateScene(path, options);
      entries.insert(entries.end(), found.begin(), found.end());
    } catch (const std::exception& error) {
      std::cerr << "evaluate: " << path << ": " << error.what() << "\n";
      good = false;
    }
  }
  std::cout << "[\n";
  for (size_t i = 0; i < entries.size(); ++i) {
    std::cout << "  " << entries[i] << (i + 1 < entries.size() ? ",\n" : "\n");
  }
  std::cout << "]\n";
  return good ? 0 : 1;
}
