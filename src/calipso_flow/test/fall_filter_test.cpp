#include "calipso_flow/fall_filter.hpp"

#include <gtest/gtest.h>

#include <random>

#include "calipso_flow/rotation.hpp"

namespace calipso::flow {
namespace {

constexpr double kFps = 30.0, kSigma = 1e-3;  // m, rad
const MotionPrior kPrior;
const Eigen::Vector3d kVelocity(0.5, 0.1, 1.0), kSpin(1.0, -3.0, 2.0);

Eigen::Vector3d fallen(double t) { return kVelocity * t + 0.5 * t * t * kPrior.gravity; }

PoseMeasurement measured(double t, const Eigen::Vector3d& position, std::mt19937& random) {
  std::normal_distribution<double> noise(0.0, kSigma);
  const auto vector = [&] {
    const double x = noise(random), y = noise(random), z = noise(random);
    return Eigen::Vector3d(x, y, z);
  };
  PoseMeasurement m;
  m.time = t;
  m.position = position + vector();
  m.rotation = rotationFromVector(vector()) * rotationFromVector(t * kSpin);
  m.covariance = kSigma * kSigma * Matrix6d::Identity();
  m.valid = true;
  return m;
}

TEST(FallFilter, saysWhereAnUnseenFallHasCome) {
  std::mt19937 random(1);
  FallFilter fall;
  for (int k = 0; k < 10; ++k) fall.take(measured(k / kFps, fallen(k / kFps), random), kPrior);
  const double later = 19 / kFps;
  EXPECT_TRUE(fall.holds(later));
  EXPECT_FALSE(fall.holds(later + 0.1));  // it may long have landed
  const MotionState state = fall.at(later);
  // A velocity from ten poses of 1 mm errs by 4 mm/s, over a third of a second; g by 5 % at most.
  EXPECT_LT((state.position - fallen(later)).norm(), 0.02);
  const Eigen::Matrix3d off = state.rotation * rotationFromVector(later * kSpin).transpose();
  // A spin from ten poses of 1 mrad, which may change by some 0.03 rad/s in as long.
  EXPECT_LT(vectorFromRotation(off).norm(), 0.04);
}

TEST(FallFilter, endsWithABounceAndBeginsAgain) {
  std::mt19937 random(2);
  FallFilter fall;
  const auto bounced = [](double t) {
    const double after = std::max(0.0, t - 8.5 / kFps);
    return Eigen::Vector3d(fallen(t) + after * Eigen::Vector3d(0.0, 0.0, 3.0));
  };
  const auto take = [&](int k) {
    fall.take(measured(k / kFps, bounced(k / kFps), random), kPrior);
  };
  for (int k = 0; k < 9; ++k) take(k);
  const PoseMeasurement after = measured(9 / kFps, bounced(9 / kFps), random);
  EXPECT_FALSE(fall.expects(after));
  EXPECT_TRUE(fall.expects(measured(9 / kFps, fallen(9 / kFps), random)));
  fall.take(after, kPrior);
  EXPECT_FALSE(fall.holds(9 / kFps));
  for (int k = 10; k < 16; ++k) take(k);
  EXPECT_TRUE(fall.holds(15 / kFps));
}

TEST(FallFilter, doesNotHoldAtRest) {
  std::mt19937 random(3);
  FallFilter fall;
  bool held = false;
  for (int k = 0; k < 20; ++k) {
    fall.take(measured(k / kFps, Eigen::Vector3d::Zero(), random), kPrior);
    held = held || fall.holds(k / kFps);
  }
  EXPECT_FALSE(held);
}

}  // namespace
}  // namespace calipso::flow
