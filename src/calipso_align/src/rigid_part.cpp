#include "calipso_align/rigid_part.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>

namespace calipso::align {
namespace {

// Points at equal strides, enough for their moments.
Points sampleOf(const Points& X) {
  constexpr int kSamples = 400;
  const int step = std::max<int>(1, static_cast<int>(X.rows()) / kSamples);
  Points sample((X.rows() + step - 1) / step, 3);
  for (int i = 0; i < sample.rows(); ++i) sample.row(i) = X.row(i * step);
  return sample;
}

}  // namespace

Eigen::Isometry3d bestRigid(const Points& from, const Points& to) {
  const Eigen::RowVector3d a = from.colwise().mean(), b = to.colwise().mean();
  const Eigen::Matrix3d cross = (to.rowwise() - b).transpose() * (from.rowwise() - a);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) sign.z() = -1.0;
  Eigen::Isometry3d best = Eigen::Isometry3d::Identity();
  best.linear() = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  best.translation() = b.transpose() - best.linear() * a.transpose();
  return best;
}

RigidPart rigidPart(const Points& X, const LowOrderMap& map) {
  const Points sample = sampleOf(X), x = map.apply(sample);
  const Eigen::RowVector3d from = sample.colwise().mean(), to = x.colwise().mean();
  const Eigen::Matrix3d R = bestRigid(sample, x).linear();

  RigidPart part;
  const Eigen::AngleAxisd turn(R);
  part.rotation = turn.angle() * turn.axis();
  part.translation = (to - from).transpose();
  part.translation_by_parameters.setZero();
  LowOrderMap::Jacobian torque = LowOrderMap::Jacobian::Zero();
  Eigen::Matrix3d S = Eigen::Matrix3d::Zero();
  for (int i = 0; i < sample.rows(); ++i) {
    const Eigen::Vector3d arm = R * (sample.row(i) - from).transpose();
    const LowOrderMap::Jacobian J = map.jacobian(sample.row(i).transpose());
    part.translation_by_parameters += J / static_cast<double>(sample.rows());
    S += arm * (x.row(i) - to);
    Eigen::Matrix3d cross;
    cross << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
    torque += cross * J;
  }
  part.rotation_by_parameters =
      (S.trace() * Eigen::Matrix3d::Identity() - S).fullPivLu().solve(torque);
  return part;
}

}  // namespace calipso::align
