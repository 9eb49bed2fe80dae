#pragma once

#include <Eigen/Geometry>

#include "calipso_scene/camera.hpp"

namespace calipso::align {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Normal equations of a step: translation (m) and turn about the body's centre (rad).
struct StepEquations {
  Matrix6 matrix = Matrix6::Zero();
  Vector6 right = Vector6::Zero();

  void add(double weight, double residual, const Vector6& row) {
    matrix += weight * row * row.transpose();
    right += weight * residual * row;
  }
};

// Where a body is in the camera frame, in relation to where it was in the key frame.
struct BodyPose {
  Eigen::Vector3d centre;  // of the body in the key frame, m
  Eigen::Isometry3d camera_from_key = Eigen::Isometry3d::Identity();

  // Of the pixel of p (camera frame) by a step.
  Eigen::Matrix<double, 2, 6> jacobian(const Camera& camera, const Eigen::Vector3d& p) const;
  void move(const Vector6& step);
};

// Solution of the equations; what they leave open stays as it is.
Vector6 solve(const StepEquations& equations);

// Weight of a squared residual that is given in parts of what is credible (Geman and McClure).
inline double credible(double squared) { return 1.0 / ((1.0 + squared) * (1.0 + squared)); }

}  // namespace calipso::align
