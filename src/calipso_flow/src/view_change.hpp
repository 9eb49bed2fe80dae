#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_flow/frame.hpp"
#include "calipso_flow/reference_view.hpp"

// How differently a rigid object shows in different poses.
namespace calipso::flow {

// Image motion of the points between two poses, px.
struct ImageMotion {
  double largest = 0.0;  // of a point
  double bend = 0.0;     // largest deviation of a point from their mean
};

ImageMotion imageMotion(const Camera& camera, const Eigen::Isometry3d& a,
                        const Eigen::Isometry3d& b, const std::vector<Eigen::Vector3d>& points);

// How differently an object shows in two poses in the camera: by the turn, rad, and by the
// distance, relative.
double viewChange(const Eigen::Isometry3d& then, const Eigen::Isometry3d& now,
                  const Eigen::Vector3d& centroid);
// The same between a reference and a pose in the world in a frame.
double viewChange(const ReferenceView& reference, const Frame& frame, const Eigen::Isometry3d& pose,
                  const Eigen::Vector3d& centroid);

// Seeds that the camera would see inside the picture, hidden or not.
int seedsInPicture(const ReferenceView& reference, const Camera& camera,
                   const Eigen::Isometry3d& pose);

}  // namespace calipso::flow
