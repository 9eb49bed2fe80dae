#include "calipso_flow/trajectory.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "../src/piece_path.hpp"
#include "measured_motion.hpp"

namespace calipso::flow {
namespace {

using namespace test;

// Depth drifts as shapes err: across gravity that is no acceleration of what falls.
TEST(Trajectory, whatFallsIsPulledDownOnly) {
  const auto drifting = [](double t) -> Eigen::Vector3d {
    return Eigen::Vector3d(0.5 * t, 0.1 * t * t, -0.5 * 9.81 * t * t);
  };
  auto data = measure(12, 0.001, 0.003, 8, drifting, still);
  for (PoseMeasurement& m : data) m.covariance(1, 1) = 0.01 * 0.01;  // in depth
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  ASSERT_EQ(fit.pieces.front().travel, Travel::kFreeFall);
  // The drift's mean velocity, 0.2 T = 0.07 m/s at most, at both ends; half a percent of g in
  // between.
  for (const MotionState& s : fit.states) EXPECT_LT(std::abs(s.acceleration.y()), 0.1);
  EXPECT_NEAR(fit.states.front().velocity.y(), fit.states.back().velocity.y(), 0.04);
}

// After a cut nothing is known of what was before: two poses make no piece, as at the clip's start.
TEST(Trajectory, noPieceOfTwoPosesBeginsAfterACut) {
  const double cut = 9.5 / kFps, bend = 11.375 / kFps;
  const auto position = [&](double t) -> Eigen::Vector3d {
    return Eigen::Vector3d(2.0 * t - (t < bend ? 0.0 : 4.0 * (t - bend)), 0.0, 0.0);
  };
  const auto poses = measure(20, 0.0001, 0.0003, 3, position, still);
  const auto pieces = likeliestPieces(poses, {cut}, testPrior(), 1.0, 8.0);
  ASSERT_EQ(pieces.size(), 3u);
  EXPECT_TRUE(pieces[1].cut);
  EXPECT_GT(pieces[2].start, 12.0 / kFps);
}

TEST(Trajectory, recognisesRest) {
  const auto data = measure(30, 0.002, 0.01, 3, still, still);
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  EXPECT_TRUE(fit.collisions.empty());
  EXPECT_FALSE(fit.movingAt(0.5));
  EXPECT_LT(fit.states[15].velocity.norm(),
            std::sqrt(fit.states[15].twistCovariance().topLeftCorner<3, 3>().trace()));
  EXPECT_GT(fit.states[15].twistCovariance()(0, 0), 0.0);
}

// Of what is mostly hidden single poses may be far off, and surer than they should be.
TEST(Trajectory, isAtRestThoughOneOrTwoPosesAreElsewhere) {
  TrajectoryParams params;
  params.still = [](const std::vector<MotionState>& states) {
    return std::all_of(states.begin(), states.end(), [&](const MotionState& s) {
      return (s.position - states.front().position).norm() < 0.02;
    });
  };
  for (const int wrong : {1, 2}) {
    auto data = measure(30, 0.002, 0.01, 3, still, still);
    for (int k = 0; k < wrong; ++k) data[6 + k].position += Eigen::Vector3d(0.1, 0.4, 0.3);
    const Trajectory fit = fitTrajectory(data, {}, testPrior(), params);
    EXPECT_TRUE(fit.collisions.empty()) << wrong;
    for (const double t : {0.1, 6.5 / kFps, 0.5})
      EXPECT_FALSE(fit.movingAt(t)) << wrong << ", " << t;
  }
}

// It does move where it rests elsewhere afterwards.
TEST(Trajectory, isNotAtRestWhereItDoesNotComeBack) {
  const auto pushed = [](double t) -> Eigen::Vector3d {
    return {0.4 * std::clamp((t - 6.0 / kFps) * kFps / 3.0, 0.0, 1.0), 0.0, 0.0};
  };
  const Trajectory fit = fitTrajectory(measure(30, 0.002, 0.01, 3, pushed, still), {}, testPrior());
  EXPECT_TRUE(fit.movingAt(7.5 / kFps));
  EXPECT_NEAR(fit.states.back().position.x(), 0.4, 0.01);
}

// Ten frames a second show two poses of a motion of a quarter of a second.
TEST(Trajectory, isNotAtRestInTwoPosesOfASlowCamera) {
  const auto pushed = [](double t) -> Eigen::Vector3d {
    return {0.1 * std::clamp((t - 6.3 / kFps) * kFps / 2.4, 0.0, 1.0), 0.0, 0.0};
  };
  auto data = measure(30, 0.002, 0.01, 3, pushed, still);
  for (PoseMeasurement& m : data) m.time *= 3.0;
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  EXPECT_TRUE(fit.movingAt(7.5 * 3.0 / kFps));
}

TEST(Trajectory, findsUniformMotionAndSpin) {
  const Eigen::Vector3d v(0.4, -0.2, 0.1), w(0.0, 0.3, 1.2);
  const auto data = measure(
      40, 0.002, 0.01, 4, [&](double t) { return Eigen::Vector3d(v * t); },
      [&](double t) { return Eigen::Vector3d(w * t); });
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  EXPECT_TRUE(fit.collisions.empty());
  EXPECT_TRUE(fit.movingAt(0.5));
  // A slope over 1.3 s from 40 points of 2 mm scatters by 0.8 mm/s, one of 10 mrad by 4 mrad/s.
  EXPECT_LT((fit.states[20].velocity - v).norm(), 0.005);
  EXPECT_LT((fit.states[20].spin - w).norm(), 0.02);
  EXPECT_LT(fit.states[20].acceleration.norm(), 1e-3);
}

TEST(Trajectory, findsGravityInFreeFall) {
  const auto data = measure(
      15, 0.001, 0.01, 5, [](double t) { return bouncing(t, 10.0, 0.0); }, still);
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  ASSERT_TRUE(fit.gravity);
  EXPECT_NEAR(fit.gravity->acceleration.z(), -9.81, 4.0 * fit.gravity->deviation);
  EXPECT_LT(fit.gravity->deviation, 0.15);
}

TEST(Trajectory, doesNotTakeACutForMotion) {
  const Eigen::Vector3d jump(0.5, 0.0, 0.0);
  const auto data = measure(
      30, 0.001, 0.01, 6,
      [&](double t) { return Eigen::Vector3d(t < 0.49 ? Eigen::Vector3d::Zero() : jump); }, still);
  const Trajectory fit = fitTrajectory(data, {14.5 / kFps}, testPrior());
  EXPECT_TRUE(fit.collisions.empty());
  for (const MotionState& state : fit.states) EXPECT_LT(state.velocity.norm(), 0.01);
}

TEST(Trajectory, carriesOnWhereNothingWasSeen) {
  const Eigen::Vector3d v(1.0, 0.0, 0.0);
  auto data = measure(
      30, 0.001, 0.01, 7, [&](double t) { return Eigen::Vector3d(v * t); }, still);
  for (int k = 20; k < 30; ++k) data[k].valid = false;
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  EXPECT_NEAR(fit.states[29].position.x(), 29 / kFps, 0.01);
  EXPECT_GT(fit.states[29].covariance(0, 0), fit.states[10].covariance(0, 0));
}

// The interval of 95 % holds the truth in 90 to 99 % of noisy repeats (7.815: three degrees).
TEST(Trajectory, velocityIntervalsAreCalibrated) {
  int inside = 0;
  constexpr int kRepeats = 300;
  const Eigen::Vector3d v(0.3, 0.1, -0.2);
  for (int i = 0; i < kRepeats; ++i) {
    const auto data = measure(
        15, 0.002, 0.01, 1000 + i, [&](double t) { return Eigen::Vector3d(v * t); }, still);
    const Trajectory fit = fitTrajectory(data, {}, testPrior());
    const Eigen::Vector3d error = fit.states[7].velocity - v;
    const Eigen::Matrix3d covariance = fit.states[7].twistCovariance().topLeftCorner<3, 3>();
    inside += error.dot(covariance.ldlt().solve(error)) < 7.815;
  }
  EXPECT_GE(inside, 0.90 * kRepeats);
  EXPECT_LE(inside, 0.99 * kRepeats);
}

// A wrong shape puts the pose off by what changes with the view: a walk of 2 mm per frame in depth,
// over ten times what single poses scatter by. Where that is stated, the velocity's interval holds.
TEST(Trajectory, anErrorThatDriftsIsNotTakenForMotion) {
  constexpr int kRepeats = 100, kFrames = 15;
  constexpr double kStep = 2e-3;
  const Eigen::Vector3d velocity(0.8, 0.3, 0.0);
  int inside = 0;
  for (int i = 0; i < kRepeats; ++i) {
    auto measurements = measure(
        kFrames, 1.5e-4, 1e-3, 900 + i, [&](double t) { return Eigen::Vector3d(t * velocity); },
        still);
    std::mt19937 random(i);
    std::normal_distribution<double> step(0.0, kStep);
    double off = 0.0;
    for (int k = 1; k < kFrames; ++k) {
      off += step(random);
      measurements[k].position.y() += off;
      measurements[k].drift(1, 1) = kStep * kStep;
    }
    const MotionState& state = fitTrajectory(measurements, {}, testPrior()).states[kFrames / 2];
    const Eigen::Vector3d error = state.velocity - velocity;
    const Eigen::Matrix3d covariance = state.twistCovariance().topLeftCorner<3, 3>();
    inside += error.dot(covariance.ldlt().solve(error)) < 7.815;  // 95 %, three degrees of freedom
  }
  EXPECT_GE(inside, 0.88 * kRepeats);  // three deviations of a count of 100 below 95
}

TEST(Trajectory, worksOnOneAndTwoFrames) {
  const auto one = measure(1, 0.001, 0.01, 8, still, still);
  EXPECT_FALSE(fitTrajectory(one, {}, testPrior()).movingAt(0.0));
  const auto two = measure(
      2, 0.0001, 0.001, 8, [](double t) { return Eigen::Vector3d(t, 0.0, 0.0); }, still);
  EXPECT_NEAR(fitTrajectory(two, {}, testPrior()).states[0].velocity.x(), 1.0, 0.05);
}

TEST(Trajectory, refusesStampsThatDoNotIncrease) {
  auto data = measure(5, 0.001, 0.01, 9, still, still);
  data[3].time = data[2].time;
  try {
    fitTrajectory(data, {}, testPrior());
    FAIL() << "equal stamps were accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("measurement 3"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace calipso::flow
