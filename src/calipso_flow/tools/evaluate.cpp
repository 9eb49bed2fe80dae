// Evaluates the dynamics on scene folders and the dense flow on folders with a true flow; see the
// package's README for the keys that are printed.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <stdexcept>

#include "calipso_scene/help.hpp"
#include "dynamics_case.hpp"
#include "filmed_case.hpp"
#include "flow_case.hpp"
#include "repeat_case.hpp"

namespace {

constexpr char kUsage[] =
    "usage: evaluate [--models aligned|true|held|DIR] [--trace DIR] [--scale N] [--filmed] "
    "[--repeats N] [--perturb N] PATH...\n"
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
    "  --perturb evaluates N further recordings of each scene: other grain, another rough "
    "placement\n"
    "  --scale   enlarges the frames first: 2 makes 1280x720 of 640x360\n";

struct Arguments {
  calipso::flow::DynamicsOptions options;
  bool filmed = false;
  int repeats = 0;
  std::vector<std::string> paths;
};

Arguments parse(int argc, char** argv) {
  calipso::helpIfAsked(argc, argv, kUsage);
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--models" && i + 1 < argc) {
      arguments.options.models = argv[++i];
    } else if (argument == "--trace" && i + 1 < argc) {
      arguments.options.trace = argv[++i];
    } else if (argument == "--repeats" && i + 1 < argc) {
      arguments.repeats = std::max(0, std::atoi(argv[++i]));
    } else if (argument == "--perturb" && i + 1 < argc) {
      arguments.options.perturbations = std::max(0, std::atoi(argv[++i]));
    } else if (argument == "--filmed") {
      arguments.filmed = true;
    } else if (argument == "--scale" && i + 1 < argc) {
      arguments.options.scale = std::max(1, std::atoi(argv[++i]));
    } else if (argument.rfind("--", 0) == 0) {
      throw std::invalid_argument("unknown option or missing value: " + argument + "\n" + kUsage);
    } else {
      arguments.paths.push_back(argument);
    }
  }
  return arguments;
}

std::vector<std::string> evaluatePath(const std::string& path,
                                      const calipso::flow::DynamicsOptions& options) {
  const bool is_flow = std::filesystem::exists(path + "/flow10.flo");
  return is_flow ? calipso::flow::evaluateFlow(path) : calipso::flow::evaluateScene(path, options);
}

void print(const std::vector<std::string>& entries) {
  std::cout << "[\n";
  for (size_t i = 0; i < entries.size(); ++i) {
    std::cout << "  " << entries[i] << (i + 1 < entries.size() ? ",\n" : "\n");
  }
  std::cout << "]\n";
}

}  // namespace

int main(int argc, char** argv) try {
  const Arguments arguments = parse(argc, argv);
  if (arguments.paths.empty() && !arguments.filmed && arguments.repeats == 0) {
    std::cerr << kUsage;
    return 2;
  }
  std::vector<std::string> entries;
  const auto append = [&](const std::vector<std::string>& more) {
    entries.insert(entries.end(), more.begin(), more.end());
  };
  bool good = true;
  if (arguments.filmed) append(calipso::flow::evaluateFilmed());
  if (arguments.repeats > 0) append(calipso::flow::evaluateRepeats(arguments.repeats));
  for (const std::string& path : arguments.paths) {
    try {
      append(evaluatePath(path, arguments.options));
    } catch (const std::exception& error) {
      std::cerr << "evaluate: " << path << ": " << error.what() << "\n";
      good = false;
    }
  }
  print(entries);
  return good ? 0 : 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 2;
}
