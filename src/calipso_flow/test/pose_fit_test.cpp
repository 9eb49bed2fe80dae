#include "calipso_flow/pose_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <random>

#include "calipso_flow/rotation.hpp"
#include "rendered_scene.hpp"

namespace calipso::flow {
namespace {

std::vector<Correspondence> correspondences(const Eigen::Isometry3d& pose, double noise, int seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> inside(-0.25, 0.25);
  std::normal_distribution<double> normal;
  const Camera camera = test::testCamera();
  std::vector<Correspondence> result;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d point(inside(random), inside(random), inside(random));
    Eigen::Vector2d pixel = camera.projectWorld(pose * point);
    pixel += noise * Eigen::Vector2d(normal(random), normal(random));
    result.push_back({point, pixel, noise * noise * Eigen::Matrix2d::Identity()});
  }
  return result;
}

Eigen::Isometry3d somePose() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotationFromVector({0.2, -0.3, 0.5});
  pose.translation() << 0.1, 0.2, -0.05;
  return pose;
}

TEST(PoseFit, isExactWithoutNoise) {
  const auto points = correspondences(somePose(), 0.0, 1);
  const PoseFit fit =
      fitPose(points, test::testCamera(), Eigen::Isometry3d::Identity(), Eigen::Vector3d::Zero());
  ASSERT_TRUE(fit.converged);
  EXPECT_TRUE(fit.world_from_object.isApprox(somePose(), 1e-7));
}

TEST(PoseFit, survivesOutliers) {
  auto points = correspondences(somePose(), 0.1, 2);
  for (size_t i = 0; i < points.size(); i += 3) points[i].pixel += Eigen::Vector2d(12.0, -9.0);
  const PoseFit fit = fitPose(points, test::testCamera(), somePose(), Eigen::Vector3d::Zero());
  ASSERT_TRUE(fit.converged);
  EXPECT_EQ(fit.inliers, 40);
  // 40 points of 0.1 px at 200 px/m: depth, the weakest direction, scatters by about 1 mm.
  EXPECT_LT((fit.world_from_object.translation() - somePose().translation()).norm(), 0.005);
}

// What an error of the shape does to the pose is stated: the same as displaced pixels make of it.
TEST(PoseFit, statesWhatAnErrorOfTheShapeDoes) {
  const Camera camera = test::testCamera();
  auto points = correspondences(somePose(), 0.0, 3);
  const Eigen::Vector2d middle = camera.projectWorld(somePose().translation());
  for (Correspondence& c : points) {
    const Eigen::Vector2d at = (c.pixel - middle) / 30.0;
    c.shape = Eigen::Vector2d(1.0, 0.5) * Eigen::RowVector3d(at.x(), at.y(), at.squaredNorm() - 1);
  }
  const auto fit = [&](const std::vector<Correspondence>& found) {
    return fitPose(found, camera, somePose(), Eigen::Vector3d::Zero());
  };
  constexpr double kShare = 0.01;  // so little that all points count fully
  Matrix6d expected = Matrix6d::Zero();
  for (int term = 0; term < kShapeTerms; ++term) {
    auto displaced = points;
    for (Correspondence& c : displaced) c.pixel += kShare * c.shape.col(term);
    const Eigen::Isometry3d pose = fit(displaced).world_from_object;
    Vector6d off;
    off << pose.translation() - somePose().translation(),
        vectorFromRotation(pose.linear() * somePose().linear().transpose());
    expected += off * off.transpose() / (kShare * kShare);
  }
  const PoseFit told = fit(points);
  ASSERT_TRUE(told.converged);
  EXPECT_LT((told.persistent - expected).norm(), 0.1 * expected.norm());
}

// 95 % of the errors lie in the 95 % ellipsoid (12.59 for six degrees of freedom).
TEST(PoseFit, covarianceIsCalibrated) {
  int inside = 0;
  constexpr int kRepeats = 300;
  const Eigen::Vector3d pivot(0.05, 0.0, -0.1);
  PoseFitParams params;
  params.floor_px = 1e-3;
  for (int i = 0; i < kRepeats; ++i) {
    const PoseFit fit = fitPose(correspondences(somePose(), 0.2, 100 + i), test::testCamera(),
                                somePose(), pivot, params);
    ASSERT_TRUE(fit.converged);
    Vector6d error;
    error << fit.world_from_object * pivot - somePose() * pivot,
        vectorFromRotation(fit.world_from_object.linear() * somePose().linear().transpose());
    inside += error.dot(fit.covariance.ldlt().solve(error)) < 12.59;
  }
  EXPECT_GE(inside, 0.90 * kRepeats);
  EXPECT_LE(inside, 0.99 * kRepeats);
}

// A shape that bulges where the model does not: smooth over it, so that it does not average out
// over the points.
TEST(PoseFit, covarianceHoldsTheErrorOfAWrongShape) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  int inside = 0;
  constexpr int kRepeats = 200;
  for (int i = 0; i < kRepeats; ++i) {
    auto points = correspondences(somePose(), 0.05, 500 + i);
    const Eigen::Vector3d wave(14.0 * normal(random), 14.0 * normal(random), 14.0 * normal(random));
    const double phase = 3.0 * normal(random), amplitude = 0.5 * normal(random);
    for (Correspondence& c : points)
      c.pixel += amplitude * std::sin(wave.dot(c.point) + phase) * Eigen::Vector2d(0.8, 0.6);
    const PoseFit fit = fitPose(points, test::testCamera(), somePose(), Eigen::Vector3d::Zero());
    ASSERT_TRUE(fit.converged);
    const Eigen::Vector3d error = fit.world_from_object.translation() - somePose().translation();
    inside += error.dot(fit.covariance.topLeftCorner<3, 3>().ldlt().solve(error)) < 7.815;
  }
  EXPECT_GE(inside, 0.8 * kRepeats);  // as if the errors were independent: less than half of them
}

// Compression leaves matches worse than they say of themselves; the outline then counts for more.
TEST(PoseFit, theOutlineHelpsWhereTextureIsSpoiled) {
  double with = 0.0, without = 0.0;
  for (int i = 0; i < 40; ++i) {
    auto points = correspondences(somePose(), 1.5, 500 + i);
    for (Correspondence& c : points) c.covariance = 0.05 * 0.05 * Eigen::Matrix2d::Identity();
    const auto error = [&] {
      const PoseFit fit = fitPose(points, test::testCamera(), somePose(), Eigen::Vector3d::Zero());
      return fit.converged ? (fit.world_from_object.translation() - somePose().translation()).norm()
                           : 1.0;
    };
    without += error();
    auto outline = correspondences(somePose(), 0.2, 900 + i);
    for (Correspondence& c : outline) {
      const Eigen::Vector2d across = Eigen::Vector2d(c.point.x(), c.point.z()).normalized(),
                            along(-across.y(), across.x());
      c.covariance += 1e6 * along * along.transpose();
      c.outline = true;
      points.push_back(c);
    }
    with += error();
  }
  EXPECT_LT(with, 0.35 * without);
}

// Matches that are as good as they say lose nothing by an outline that is worse.
TEST(PoseFit, theOutlineIsWeighedByHowWellItFits) {
  auto points = correspondences(somePose(), 0.02, 7);
  for (Correspondence& c : correspondences(somePose(), 2.0, 8)) {
    c.covariance = 0.05 * 0.05 * Eigen::Matrix2d::Identity() +
                   Eigen::Vector2d(0.0, 1e3).asDiagonal().toDenseMatrix();
    c.outline = true;
    points.push_back(c);
  }
  const PoseFit fit = fitPose(points, test::testCamera(), somePose(), Eigen::Vector3d::Zero());
  ASSERT_TRUE(fit.converged);
  // 60 points of 0.02 px at 200 px/m: the weakest direction scatters by about 0.2 mm.
  EXPECT_LT((fit.world_from_object.translation() - somePose().translation()).norm(), 0.001);
}

// Points whose reference errs show another pose than the outline: together they are nearer to the
// truth than either alone, and as near as is stated.
TEST(PoseFit, theOutlineTellsWhatThePointsReferenceErrsBy) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  Vector6d deviation;
  deviation << 0.004, 0.004, 0.004, 0.02, 0.02, 0.02;
  const Matrix6d reference = deviation.cwiseAbs2().asDiagonal();
  double taken_as_exact = 0.0, told = 0.0, by_outline = 0.0;
  int inside = 0;
  constexpr int kRepeats = 200;
  for (int i = 0; i < kRepeats; ++i) {
    Vector6d off;
    for (int k = 0; k < 6; ++k) off[k] = deviation[k] * normal(random);
    auto points = correspondences(movePose(somePose(), pivot, off), 0.05, 1000 + 2 * i);
    const size_t count = points.size();
    for (Correspondence& c : correspondences(somePose(), 0.8, 1001 + 2 * i)) {
      const Eigen::Vector2d across = Eigen::Vector2d(c.point.x(), c.point.z()).normalized(),
                            along(-across.y(), across.x());
      c.covariance += 1e6 * along * along.transpose();
      c.outline = true;
      points.push_back(c);
    }
    const auto fitted = [&](const Matrix6d& error) {
      return fitPose(points, test::testCamera(), somePose(), pivot, {}, error);
    };
    const auto error = [&](const PoseFit& fit) {
      Vector6d by;
      by << fit.world_from_object * pivot - somePose() * pivot,
          vectorFromRotation(fit.world_from_object.linear() * somePose().linear().transpose());
      return by;
    };
    const PoseFit fit = fitted(reference);
    ASSERT_TRUE(fit.converged);
    EXPECT_EQ(std::count(fit.inlier.begin(), fit.inlier.begin() + count, true), fit.inliers);
    told += error(fit).squaredNorm();
    taken_as_exact += error(fitted(Matrix6d::Zero())).squaredNorm();
    by_outline += error(fitted(1e6 * reference)).squaredNorm();
    inside += error(fit).dot(fit.covariance.ldlt().solve(error(fit))) < 12.59;
  }
  EXPECT_LT(told, 0.7 * taken_as_exact);
  EXPECT_LT(told, 0.7 * by_outline);
  EXPECT_GE(inside, 0.90 * kRepeats);  // 95 % of a chi-squared of 6 degrees of freedom
}

TEST(PoseFit, saysSoWhenThereAreTooFewPoints) {
  auto points = correspondences(somePose(), 0.0, 3);
  points.resize(4);
  const PoseFit fit = fitPose(points, test::testCamera(), somePose(), Eigen::Vector3d::Zero());
  EXPECT_FALSE(fit.converged);
  EXPECT_TRUE(fit.world_from_object.isApprox(somePose()));
}

TEST(MovePose, turnsAboutThePivot) {
  const Eigen::Vector3d pivot(0.3, -0.1, 0.2);
  Vector6d motion;
  motion << 0.0, 0.0, 0.0, 0.1, 0.2, -0.3;
  const Eigen::Isometry3d moved = movePose(somePose(), pivot, motion);
  EXPECT_TRUE((moved * pivot).isApprox(somePose() * pivot, 1e-12));
  EXPECT_TRUE(vectorFromRotation(moved.linear() * somePose().linear().transpose())
                  .isApprox(motion.tail<3>(), 1e-9));
}

}  // namespace
}  // namespace calipso::flow
