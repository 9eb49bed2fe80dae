#pragma once

#include <string>
#include <vector>

namespace calipso::flow {

// Runs the dynamics on a scene folder and compares with its truth: one JSON object per object.
// @param models  "true", "held" or a folder of aligned meshes; see evaluate's usage
// @param trace   folder for one CSV file per object; empty: none
std::vector<std::string> evaluateScene(const std::string& directory, const std::string& models,
                                       const std::string& trace);

}  // namespace calipso::flow
