#include "body_pose.hpp"

#include <Eigen/Cholesky>

namespace calipso::align {

Eigen::Matrix<double, 2, 6> BodyPose::jacobian(const Camera& camera,
                                               const Eigen::Vector3d& p) const {
  const Eigen::Vector3d arm = p - camera_from_key * centre;
  Eigen::Matrix<double, 3, 6> motion;
  motion.leftCols<3>().setIdentity();
  for (int k = 0; k < 3; ++k) motion.col(3 + k) = Eigen::Vector3d::Unit(k).cross(arm);
  return camera.projectJacobian(p) * motion;
}

void BodyPose::move(const Vector6& step) {
  const Eigen::Vector3d pivot = camera_from_key * centre, turn = step.tail<3>();
  const double angle = turn.norm();
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (angle > 0.0) motion.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  motion.translation() = pivot + step.head<3>() - motion.linear() * pivot;
  camera_from_key = motion * camera_from_key;
}

Vector6 solve(const StepEquations& equations) {
  Matrix6 damped = equations.matrix;
  damped.diagonal() = (1.0 + 1e-6) * damped.diagonal().array() + 1e-9;
  return damped.ldlt().solve(equations.right);
}

}  // namespace calipso::align
