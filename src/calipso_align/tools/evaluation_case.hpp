#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calipso_align/alignment.hpp"

namespace calipso::align {

// What is known to be true of a case. Read by evaluators only.
struct Truth {
  TriangleMesh mesh;  // true shape, object frame
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  bool correspondence = false;       // vertex i is the model's vertex i
  std::vector<ContourLoop> contour;  // empty: unknown
  cv::Mat1b visible;                 // 255 where the object is seen; empty: unknown
  cv::Mat1b ignored;                 // 255 where something hides the object or may do so
};

// One object to be fitted, with everything a user has.
struct EvaluationCase {
  std::string name, object;
  std::optional<double> deformation_percent;
  Camera camera;
  TriangleMesh cad;
  Eigen::Isometry3d rough = Eigen::Isometry3d::Identity();
  std::vector<ContourLoop> contour;
  cv::Mat image;         // the key frame; empty: none
  AlignOptions options;  // planes and depth of the scene
  std::optional<double> ms_segment;
  std::optional<double> segmentation_iou;
  std::optional<Truth> truth;
};

struct CaseOptions {
  bool use_depth = true;
};

// Cases of a folder: with alignment.yaml one per deformation, with scene.yaml one per object.
// @throw std::runtime_error / std::invalid_argument naming file, what is wrong and the remedy
std::vector<EvaluationCase> loadCases(const std::string& directory, const CaseOptions& options);

}  // namespace calipso::align
