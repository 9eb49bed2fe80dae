#pragma once

#include "calipso_align/alignment.hpp"
#include "calipso_align/contour_term.hpp"
#include "calipso_align/depth_term.hpp"
#include "calipso_align/observation.hpp"
#include "calipso_align/silhouette.hpp"
#include "calipso_align/support_term.hpp"

namespace calipso::align {

// What all stages of one fit share; camera frame throughout.
struct FitProblem {
  Points X;  // #V x 3, the model at the rough pose, m
  MeshTopology topology;
  Camera camera;
  ContourTarget target;
  cv::Mat1b inside;   // 255 within the contour, whole picture
  cv::Mat1b foreign;  // 255 in spurs of it that no part of the model can be; or empty
  cv::Mat1b hiding;   // 255 where the picture shows something nearer than the object; or empty
  DepthTarget depth;  // empty: none
  std::vector<SurfacePoint> surface;  // of the model, to be compared with it
  std::vector<SupportTarget> supports;
  double extent_px = 0.0;                            // diagonal of the contour's bounding box
  double model_size = 0.0;                           // diagonal of the model, m
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // of the object frame, at the rough pose

  bool depthIsKnown() const;  // from a depth image, or because the object stands on something
};

// @throw std::invalid_argument as align()
FitProblem makeFitProblem(const TriangleMesh& cad, const Camera& camera,
                          const Eigen::Isometry3d& initial_world_from_object,
                          const std::vector<ContourLoop>& contour, const AlignOptions& options);

// How strictly the model is held to what was seen.
struct MeasureSettings {
  ContourTermOptions contour;
  double contour_sigma_px = 1.0;         // of one independent measurement of the contour ...
  double contour_correlation_px = 10.0;  // ... of which there is one every so many pixels
  double depth_robust = 0.05;            // in model sizes
  double depth_sigma = 0.003;            // in model sizes
  double depth_samples = 200.0;          // how many independent measurements it is worth
  double support_sigma = 0.002;          // in model sizes
};

// All measurements of the model whose vertices are x; weights are information.
Rows measure(const FitProblem& problem, const Points& x, const MeasureSettings& settings);

}  // namespace calipso::align
