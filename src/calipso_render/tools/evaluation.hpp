#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace calipso::render {

// One case's figures in output order; nullopt where the folder holds no truth for one.
struct Figures {
  std::string name;
  std::vector<std::pair<std::string, std::optional<double>>> values;
};

struct EvaluationOptions {
  std::string pictures;  // folder for pictures to look at; empty: none
  // folder for pictures of each case: video, emptied, objects lifted; turntable(); empty: none
  std::string summaries;
  std::string sheets;            // folder for blind sheets; empty: none
  bool appearance_only = false;  // leaves background and times out
  int enlarge = 1;               // times: pictures, and what is known of them
};

// Runs the whole renderer on a scene folder, the true shape and masks standing in for alignment and
// segmentation. Makes the options' folders where they are missing.
// @throw std::runtime_error / std::invalid_argument if the folder cannot be read, or pictures not
// written
Figures evaluateScene(const std::string& directory, const EvaluationOptions& options);

}  // namespace calipso::render
