#pragma once

#include <yaml-cpp/yaml.h>

#include "evaluation_case.hpp"

namespace calipso::align {

// A 4 x 4 matrix, row by row. @throw std::runtime_error naming the file
Eigen::Isometry3d poseOf(const YAML::Node& node, const std::string& file);

// Shape S, its deformed versions S_<d> and their contours.
std::vector<EvaluationCase> loadAlignmentFolder(const std::string& directory);

// The objects of a scene, segmented from its rectangles and strokes; truth where the folder has it.
std::vector<EvaluationCase> loadSceneFolder(const std::string& directory,
                                            const CaseOptions& options);

}  // namespace calipso::align
