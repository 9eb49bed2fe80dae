#pragma once

#include <string>
#include <vector>

namespace calipso::flow {

struct DynamicsOptions {
  std::string models =
      "aligned";          // "aligned", "true", "held" or a folder of meshes; see evaluate's usage
  std::string trace;      // folder for one CSV file per object; empty: none
  int scale = 1;          // the frames are enlarged by this factor first
  int perturbations = 0;  // so many recordings of the scene are looked at besides; see Perturbation
};

// Runs the dynamics on a scene folder and compares with its truth: one JSON object per object.
std::vector<std::string> evaluateScene(const std::string& directory,
                                       const DynamicsOptions& options);

}  // namespace calipso::flow
