#include "calipso_flow/pose_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "calipso_flow/rotation.hpp"
#include "calipso_scene/median.hpp"
#include "shared_error.hpp"

namespace calipso::flow {
namespace {

constexpr int kLeastPoints = 2;
constexpr double kRobust = 3.0;  // deviations: residuals beyond count less and less

// Residuals and their derivatives by the motion of movePose(), for one pose.
struct Linearisation {
  std::vector<Eigen::Vector2d> residual;  // px
  std::vector<Eigen::Matrix<double, 2, 6>> jacobian;
  std::vector<Eigen::Matrix2d> information;  // 1/px^2
  std::vector<bool> outline;
  std::vector<double> alike;
};

// @param off  what the pose that the points show is off by, see fitPose
Linearisation linearise(const std::vector<Correspondence>& correspondences, const Camera& camera,
                        const Eigen::Isometry3d& object, const Vector6d& off,
                        const Eigen::Vector3d& pivot, double floor) {
  Linearisation lin;
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  const Eigen::Isometry3d shown = off.isZero(0.0) ? object : movePose(object, pivot, off);
  for (const Correspondence& c : correspondences) {
    const Eigen::Isometry3d& pose = c.outline ? object : shown;
    const Eigen::Vector3d p_camera = camera_from_world * (pose * c.point);
    if (p_camera.z() <= 0.0) {
      lin.residual.emplace_back(1e6, 1e6);
      lin.jacobian.emplace_back(Eigen::Matrix<double, 2, 6>::Zero());
    } else {
      lin.residual.push_back(camera.project(p_camera) - c.pixel);
      Eigen::Matrix<double, 3, 6> motion;
      motion << Eigen::Matrix3d::Identity(), -skew(pose.linear() * (c.point - pivot));
      lin.jacobian.push_back(camera.projectJacobian(p_camera) * camera_from_world.linear() *
                             motion);
    }
    const Eigen::Matrix2d covariance = c.covariance + floor * floor * Eigen::Matrix2d::Identity();
    lin.information.push_back(covariance.inverse());
    lin.outline.push_back(c.outline);
    lin.alike.push_back(c.alike);
  }
  return lin;
}

// Mahalanobis lengths of the residuals.
std::vector<double> lengths(const Linearisation& lin) {
  std::vector<double> result;
  for (size_t i = 0; i < lin.residual.size(); ++i) {
    result.push_back(std::sqrt(lin.residual[i].dot(lin.information[i] * lin.residual[i])));
  }
  return result;
}

// Robust deviations of the residuals over their own, points and outline apart: a picture that is
// compressed, noisy or blurred spoils the texture by more than matches say of themselves, and the
// outline less.
struct Deviations {
  double points = 0.0, outline = 0.0;
  double of(bool on_outline) const { return std::max(1.0, on_outline ? outline : points); }
};

// The median of a standard normal's length is 1.1774 in two dimensions, 0.6745 in one.
Deviations robustDeviations(const Linearisation& lin, const std::vector<double>& lengths) {
  std::vector<double> points, outline;
  for (size_t i = 0; i < lengths.size(); ++i)
    (lin.outline[i] ? outline : points).push_back(lengths[i]);
  return {median(points) / 1.1774, median(outline) / 0.6745};
}

struct NormalEquations {
  Matrix6d matrix = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
};

// Adds what the points say, or the outline. Geman-McClure: weight (s^2 / (s^2 + r^2))^2 with r in
// the deviations found.
void addWeighted(const Linearisation& lin, const std::vector<double>& lengths,
                 const Deviations& found, double scale, bool outline, NormalEquations& normal) {
  const double deviation = found.of(outline);
  for (size_t i = 0; i < lin.residual.size(); ++i) {
    if (lin.outline[i] != outline) continue;
    const double length = lengths[i] / deviation;
    const double ratio = scale * scale / (scale * scale + length * length);
    const double weight = ratio * ratio / (deviation * deviation);
    const Eigen::Matrix<double, 6, 2> weighted =
        weight * lin.jacobian[i].transpose() * lin.information[i];
    normal.matrix += weighted * lin.jacobian[i];
    normal.right -= weighted * lin.residual[i];
  }
}

// Directions that the tracks do not determine keep their start: a weak prior of one part in 1e-9.
Vector6d solveStep(const NormalEquations& normal) {
  Matrix6d damped = normal.matrix;
  for (int i = 0; i < 6; ++i) damped(i, i) *= 1.0 + 1e-9;
  return damped.ldlt().solve(normal.right);
}

// S of (A^-1 + C)^-1 = S A: what is left of the information A if its source errs by C.
Matrix6d shareLeft(const Matrix6d& information, const Matrix6d& covariance) {
  if (covariance.isZero(0.0)) return Matrix6d::Identity();
  return (Matrix6d::Identity() + information * covariance).inverse();
}

// The pose's step; that of the points' common error is eliminated.
// @param off  that error; out: after the step
Vector6d solveStep(const Linearisation& lin, const std::vector<double>& lengths,
                   const Deviations& found, double scale, const Matrix6d& reference,
                   Vector6d& off) {
  NormalEquations points;
  addWeighted(lin, lengths, found, scale, false, points);
  const Matrix6d share = shareLeft(points.matrix, reference);
  NormalEquations normal{share * points.matrix, share * (points.right + points.matrix * off)};
  addWeighted(lin, lengths, found, scale, true, normal);
  const Vector6d step = solveStep(normal);
  off = reference * share * (points.right + points.matrix * (off - step));
  return step;
}

// A fit's inliers that are not of the outline, as least squares has them.
// @param share  of what they tell, see shareLeft
WhitenedTracks whitened(const std::vector<Correspondence>& correspondences,
                        const Linearisation& lin, const std::vector<bool>& inlier,
                        const Matrix6d& share) {
  WhitenedTracks result;
  for (size_t i = 0; i < inlier.size(); ++i) {
    if (!inlier[i] || lin.outline[i]) continue;
    const Eigen::Matrix2d root =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(lin.information[i]).operatorSqrt();
    result.pixel.push_back(correspondences[i].pixel);
    result.residual.push_back(root * lin.residual[i]);
    result.jacobian.push_back(root * lin.jacobian[i] * share.transpose());
  }
  return result;
}

// Sums of A^T A over the inliers, A = Jacobian in units of its own deviation.
struct Information {
  Matrix6d points = Matrix6d::Zero(), outline = Matrix6d::Zero();
  Matrix6d outline_apart = Matrix6d::Zero();  // of its points' own errors, which are not alike
  Matrix6d geometry = Matrix6d::Zero();       // of all, each counted alike, 1/px^2
  // sum of A^T S over the points, S = what the terms of the shape's error do to a pixel
  Eigen::Matrix<double, 6, kShapeTerms> shape = Eigen::Matrix<double, 6, kShapeTerms>::Zero();
  int outline_inliers = 0;
};

Information chooseInliers(const std::vector<Correspondence>& correspondences,
                          const Linearisation& lin, const std::vector<double>& lengths,
                          const Deviations& found, double limit, PoseFit& fit) {
  Information sum;
  for (size_t i = 0; i < lengths.size(); ++i) {
    fit.inlier.push_back(lengths[i] < limit * found.of(lin.outline[i]));
    if (!fit.inlier.back()) continue;
    const Matrix6d told = lin.jacobian[i].transpose() * lin.information[i] * lin.jacobian[i];
    (lin.outline[i] ? sum.outline : sum.points) += told;
    if (lin.outline[i]) sum.outline_apart += told / lin.alike[i];
    sum.shape += lin.jacobian[i].transpose() * lin.information[i] * correspondences[i].shape;
    ++(lin.outline[i] ? sum.outline_inliers : fit.inliers);
    // Across an outline, or in both directions.
    const double most = lin.information[i].trace() / (lin.outline[i] ? 1.0 : 2.0);
    sum.geometry += told / most;
  }
  return sum;
}

void judge(const std::vector<Correspondence>& correspondences, const Linearisation& lin,
           const PoseFitParams& params, const Matrix6d& reference, PoseFit& fit) {
  const std::vector<double> all = lengths(lin);
  const Deviations found = robustDeviations(lin, all);
  fit.deviation = found.points;
  const Information sum = chooseInliers(correspondences, lin, all, found, params.inlier_sigma, fit);
  // A point of the outline tells one coordinate of two. Of a small object there is little else; but
  // without any point what moves may be what is behind it.
  if (fit.inliers < kLeastPoints || fit.inliers + sum.outline_inliers / 2 < params.least_inliers)
    return;
  const double of_points = found.of(false) * found.of(false),
               of_outline = found.of(true) * found.of(true);
  const Matrix6d told = sum.points / of_points, share = shareLeft(told, reference);
  const Eigen::LDLT<Matrix6d> factor(share * told + sum.outline / of_outline);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0.0)) return;
  fit.common = (fit.inliers + 0.5 * sum.outline_inliers) * params.common_px * params.common_px *
               sum.geometry.inverse();
  const SharedError shared =
      sharedError(whitened(correspondences, lin, fit.inlier, share), found.points, params.patch_px);
  const Matrix6d alone = shared.alone / (of_points * of_points) + sum.outline_apart / of_outline;
  const Matrix6d together =
      shared.together / (of_points * of_points) + (sum.outline - sum.outline_apart) / of_outline;
  const Matrix6d inverse = factor.solve(Matrix6d::Identity());
  const Eigen::Matrix<double, 6, kShapeTerms> bias = inverse * share * sum.shape / of_points;
  const Matrix6d passed_on = inverse * share * told;  // of the reference's error
  fit.persistent = inverse * together * inverse + bias * bias.transpose() +
                   passed_on * reference * passed_on.transpose();
  fit.covariance = inverse * alone * inverse + fit.persistent;
  fit.converged = fit.covariance.allFinite();
}

}  // namespace

Eigen::Isometry3d shiftInPicture(const Camera& camera, const Eigen::Isometry3d& pose,
                                 const Eigen::Vector3d& pivot, const Eigen::Vector2d& pixels) {
  const double depth = (camera.world_from_camera.inverse() * (pose * pivot)).z();
  const Eigen::Vector3d shift(pixels.x() * depth / camera.fx, pixels.y() * depth / camera.fy, 0.0);
  Eigen::Isometry3d moved = pose;
  moved.translation() += camera.world_from_camera.linear() * shift;
  return moved;
}

Eigen::Isometry3d movePose(const Eigen::Isometry3d& world_from_object, const Eigen::Vector3d& pivot,
                           const Vector6d& motion) {
  const Eigen::Vector3d position = world_from_object * pivot + motion.head<3>();
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.linear() = rotationFromVector(motion.tail<3>()) * world_from_object.linear();
  moved.translation() = position - moved.linear() * pivot;
  return moved;
}

PoseFit fitPose(const std::vector<Correspondence>& correspondences, const Camera& camera,
                const Eigen::Isometry3d& start, const Eigen::Vector3d& pivot,
                const PoseFitParams& params, const Matrix6d& reference) {
  PoseFit fit;
  fit.world_from_object = start;
  if (static_cast<int>(correspondences.size()) < params.least_inliers) return fit;
  Vector6d off = Vector6d::Zero();
  Linearisation lin = linearise(correspondences, camera, start, off, pivot, params.floor_px);
  double scale = std::max(4.0, params.start_scale_px / params.floor_px);
  for (int iteration = 0; iteration < params.max_iterations; ++iteration) {
    const std::vector<double> residuals = lengths(lin);
    const Vector6d step =
        solveStep(lin, residuals, robustDeviations(lin, residuals), scale, reference, off);
    if (!step.allFinite()) return fit;
    fit.world_from_object = movePose(fit.world_from_object, pivot, step);
    lin = linearise(correspondences, camera, fit.world_from_object, off, pivot, params.floor_px);
    const bool annealed = scale <= kRobust;
    const double change = (lin.jacobian[0] * step).norm();
    if (annealed && change < 1e-4) break;
    scale = std::max(kRobust, 0.5 * scale);
  }
  judge(correspondences, lin, params, reference, fit);
  return fit;
}

}  // namespace calipso::flow
