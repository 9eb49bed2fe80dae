#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_scene/camera.hpp"

namespace calipso::flow {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// What a model's shape errs by all over, as seen from one side: its depth leans in two directions
// and bulges. From another side that looks like a motion unless it is told from one.
constexpr int kShapeTerms = 3;

// A point of an object's surface and where it was found in the picture.
struct Correspondence {
  Eigen::Vector3d point;       // object frame, m
  Eigen::Vector2d pixel;       // px
  Eigen::Matrix2d covariance;  // of pixel, px^2
  bool outline = false;  // found across the outline only; how well such are found is judged apart
  double alike = 1.0;    // so many near it err with it, and `covariance` is as many times its own
  // px by which the pixel moves with each of the first terms of the shape's error, in units of what
  // is expected of them
  Eigen::Matrix<double, 2, kShapeTerms> shape = Eigen::Matrix<double, 2, kShapeTerms>::Zero();
};

struct PoseFitParams {
  double start_scale_px = 8.0;  // residuals up to this count fully at first, then less and less
  double floor_px = 0.03;       // no track is better than this: model error, compression
  double inlier_sigma = 4.0;    // a track further off than this many deviations does not count
  // error that all tracks of a frame may share, and that changes slowly: of how looks are resampled
  // and lit
  double common_px = 0.004;
  double patch_px = 0.0;  // side of the squares by which points were found: neighbours share noise
  int max_iterations = 30;
  int least_inliers = 6;  // a point of the outline counts half
};

struct PoseFit {
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  // of (m of the pivot, rad), world axes
  // The part of it that stays from frame to frame as long as the object shows the same side.
  Matrix6d persistent = Matrix6d::Zero();
  // the same of the error that all tracks share; not part of covariance
  Matrix6d common = Matrix6d::Zero();
  std::vector<bool> inlier;  // per correspondence
  int inliers = 0;           // of those that are not of the outline
  double deviation = 0.0;    // robust deviation of their residuals over their own, 1 = as expected
  bool converged = false;
};

// Pose of a rigid object from points found in one picture: robust Gauss-Newton on the reprojection
// error, the scale of the Geman-McClure weight shrinking from start_scale_px to the noise found.
// @param start  first guess of world_from_object
// @param pivot  object frame, m; the point whose position the covariance speaks of
// @param reference  covariance (m of the pivot, rad), world axes, of an error that all points but
//                   the outline's have in common: that of the pose they were taken from. The
//                   outline tells it in part; the pose's covariance holds what is left.
PoseFit fitPose(const std::vector<Correspondence>& correspondences, const Camera& camera,
                const Eigen::Isometry3d& start, const Eigen::Vector3d& pivot,
                const PoseFitParams& params = {}, const Matrix6d& reference = Matrix6d::Zero());

// Moves a pose parallel to the picture plane, so that its pivot (object frame, m) moves by
// `pixels`.
Eigen::Isometry3d shiftInPicture(const Camera& camera, const Eigen::Isometry3d& pose,
                                 const Eigen::Vector3d& pivot, const Eigen::Vector2d& pixels);

// Moves a pose by (translation of the pivot, rotation vector about it), world axes.
Eigen::Isometry3d movePose(const Eigen::Isometry3d& world_from_object, const Eigen::Vector3d& pivot,
                           const Vector6d& motion);

}  // namespace calipso::flow
