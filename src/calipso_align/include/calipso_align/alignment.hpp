#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_align/contour.hpp"
#include "calipso_scene/camera.hpp"
#include "calipso_scene/scene.hpp"
#include "calipso_scene/triangle_mesh.hpp"

// Fits a stock model to an object's contour (paper, section 5, eqs. 5-9): rigid motion and
// deformation together.
//  paper   code                    meaning
//  S, S*   cad, mesh               stock model, deformed model
//  R, t    world_from_object       rigid motion
//  du      mesh - cad              deformation, carried by a grid of elements with stiffness K
//  p       contour                 silhouette in the picture
//  kappa   1 / elastic_weight      how stiff the contour is against the model
namespace calipso::align {

enum class Method {
  kStaged,  // similarity, low-order deformation, then elements with re-linearised correspondences
  kLiteral  // eq. 9 as it stands: constant linear K, nearest points, constant kappa
};

// Depth of the scene along the optical axis, registered with the picture.
struct DepthObservation {
  cv::Mat1f depth;  // m; 0 or NaN: unknown
};

struct AlignOptions {
  Method method = Method::kStaged;
  std::vector<int> levels = {600, 2000};   // about how many nodes the grids have, coarse to fine
  double rotation_sigma_deg = 4.5;         // of the rough placement, per axis
  double poissons_ratio = 0.0;             // of the regulariser
  bool judge_depth = true;                 // whether the result says how far it may be off in 3D
  double elastic_weight = 1.0;             // final stiffness of the model against the contour
  std::vector<SupportPlane> planes;        // world; the object does not go through them
  std::optional<DepthObservation> depth;
};

struct StageTime {
  std::string stage;
  double ms = 0.0;  // wall time
};

struct AlignmentResult {
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  // of translation (m) and rotation vector (rad), world axes
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  TriangleMesh mesh;  // S*, object frame, the order of the stock model
  TriangleMesh rest;  // S, as given
  // per loop and point; positive: the model reaches too far out; NaN: unknown or without
  // counterpart
  std::vector<std::vector<float>> residual_px;
  double distance_sigma = 0.0;   // deviation of the centroid's distance, as part of it
  bool placed = false;           // false: the rough placement was of no use, nothing was fitted
  double met_mean_px = 0.0;      // of known points that the model meets
  double contour_mean_px = 0.0;  // of known points
  double contour_p95_px = 0.0;
  // if asked: mean distance of the surface from the true one, and root of its mean square,
  // predicted, in parts of the model's diagonal
  double expected_error = 0.0;
  double expected_rms = 0.0;
  double off_probability = 0.0;  // that it is further away than a result that is trusted may be
  double shape_off_probability = 0.0;  // the same, had it the right distance
  double noise_px = 0.0;               // estimated noise of the contour
  double scale = 1.0;                  // size of S* relative to S
  double deformation = 0.0;            // how far S had to be deformed: r.m.s. strain, estimated
  bool trusted = false;
  std::string reason;  // why not, and what to do
  std::vector<StageTime> times;
};

// @param initial_world_from_object  rough placement: some 10 degrees and 5 % of the distance off
// @param contour                    loops of one object, sub-pixel
// @throw std::invalid_argument naming what is wrong with mesh, camera, pose or contour, and the
// remedy
AlignmentResult align(const TriangleMesh& cad, const Camera& camera,
                      const Eigen::Isometry3d& initial_world_from_object,
                      const std::vector<ContourLoop>& contour, const AlignOptions& options = {});

// The model where the user put it, with the reason why nothing better is known.
AlignmentResult unaligned(const TriangleMesh& cad, const Eigen::Isometry3d& pose,
                          const std::string& reason);

// Milliseconds of all stages.
double totalMs(const AlignmentResult& result);

}  // namespace calipso::align
