#include "calipso_flow/trajectory.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "../src/piece_path.hpp"
#include "calipso_flow/rotation.hpp"

namespace calipso::flow {
namespace {

constexpr double kFps = 30.0;

MotionPrior testPrior() {
  MotionPrior prior;
  prior.position = 10.0;
  prior.velocity = 9.0;
  prior.acceleration = 90.0;
  return prior;
}

// Noisy poses of a motion given by position and rotation vector over time.
template <class Position, class Rotation>
std::vector<PoseMeasurement> measure(int frames, double sigma_m, double sigma_rad, int seed,
                                     Position position, Rotation rotation) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
  };
  std::vector<PoseMeasurement> result;
  for (int k = 0; k < frames; ++k) {
    PoseMeasurement m;
    m.time = k / kFps;
    m.position = position(m.time) + noise(sigma_m);
    m.rotation = rotationFromVector(noise(sigma_rad)) * rotationFromVector(rotation(m.time));
    m.covariance.setZero();
    m.covariance.diagonal() << Eigen::Vector3d::Constant(sigma_m * sigma_m),
        Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
    m.valid = true;
    result.push_back(m);
  }
  return result;
}

Eigen::Vector3d still(double) { return Eigen::Vector3d::Zero(); }

// Falls from rest, and bounces back with `restitution` at `tc`.
Eigen::Vector3d bouncing(double t, double tc, double restitution) {
  const Eigen::Vector3d g(0.0, 0.0, -9.81);
  if (t < tc) return 0.5 * g * t * t;
  const Eigen::Vector3d after = -restitution * g * tc;
  return 0.5 * g * tc * tc + after * (t - tc) + 0.5 * g * (t - tc) * (t - tc);
}

// Comes down on a corner, turns fast for a third of a frame, and leaves from an edge: one
// collision, whose velocities are those before and after both.
TEST(Trajectory, tellsTwoImpactsWithinAFrameAsOne) {
  const double first = 10.1 / kFps, second = 10.4 / kFps;
  const Eigen::Vector3d g(0.0, 0.0, -9.81), v(1.0, 0.0, 0.3), between(0.8, -0.3, -2.2),
      after(0.8, -0.7, 1.4);
  const Eigen::Vector3d arrived = v * first + 0.5 * g * first * first,
                        left = arrived + between * (second - first);
  const Eigen::Vector3d spin(0.0, 4.0, 0.0);
  const auto position = [&](double t) -> Eigen::Vector3d {
    if (t < first) return v * t + 0.5 * g * t * t;
    const double s = t - second;
    return s < 0.0 ? Eigen::Vector3d(arrived + between * (t - first))
                   : Eigen::Vector3d(left + after * s + 0.5 * g * s * s);
  };
  const auto rotation = [&](double t) -> Eigen::Vector3d {
    const double fast = std::clamp(t, first, second) - first, slow = std::min(t, first),
                 later = std::max(0.0, t - second);
    return spin * slow + 6.0 * spin * fast + 1.5 * spin * later;
  };
  const Trajectory fit =
      fitTrajectory(measure(20, 0.001, 0.003, 5, position, rotation), {}, testPrior());
  ASSERT_EQ(fit.collisions.size(), 1u);
  const Collision& impact = fit.collisions.front();
  EXPECT_GT(fit.pieces.back().contact, 0.0);
  EXPECT_NEAR(impact.time, 0.5 * (first + second), 0.3 / kFps);
  EXPECT_LT((impact.before.velocity - (v + g * first)).norm(), 0.1);
  EXPECT_LT((impact.after.velocity - after).norm(), 0.1);
  EXPECT_LT((impact.after.spin - 1.5 * spin).norm(), 0.2);
}

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

// That a collision is likely where it strikes something does not make it likelier than not.
TEST(Trajectory, contactAloneIsNoEvidenceOfACollision) {
  const auto collisions = [](double strikes) {
    const auto position = [](double t) { return Eigen::Vector3d(t, 0.0, 0.0); };
    auto data = measure(16, 0.002, 0.005, 4, position, still);
    for (PoseMeasurement& m : data) m.strikes = strikes;
    TrajectoryParams params;
    params.least_evidence = 0.0;
    return fitTrajectory(data, {}, testPrior(), params).collisions.size();
  };
  EXPECT_EQ(collisions(40.0), collisions(0.0));
}

// A bounce by 0.7 m/s in poses of 8 mm is found where the body is known to have struck something;
// and what has struck nothing is not made to bounce by that.
TEST(Trajectory, whatIsKnownOfTheSurroundingsTellsAWeakBounce) {
  constexpr double kImpact = 10.4 / kFps;
  const Eigen::Vector3d g(0.0, 0.0, -9.81), start(0.3, 0.0, 1.7), turned(-0.35, 0.14, 0.6);
  const auto collisions = [&](int seed, double share, bool known) {
    const auto position = [&](double t) -> Eigen::Vector3d {
      return start * t + 0.5 * g * t * t + share * std::max(0.0, t - kImpact) * turned;
    };
    auto data = measure(22, 0.008, 0.02, seed, position, still);
    for (PoseMeasurement& m : data) m.falls = known ? 1.5 : 0.0, m.strikes = known ? -2.0 : 0.0;
    if (known) data[11].strikes = 4.0;
    return fitTrajectory(data, {}, testPrior()).collisions;
  };
  size_t unaided = 0;
  for (int seed = 1; seed <= 5; ++seed) {
    unaided += collisions(seed, 1.0, false).size();
    const auto found = collisions(seed, 1.0, true);
    ASSERT_EQ(found.size(), 1u) << seed;
    EXPECT_NEAR(found.front().time, kImpact, 0.5 / kFps) << seed;
    EXPECT_TRUE(collisions(seed, 0.0, true).empty()) << seed;
  }
  EXPECT_LT(unaided, 5u);
}

// The same change of velocity, up and down: nothing below pushes down.
TEST(Trajectory, aWeakPushDownIsNoImpact) {
  constexpr double kImpact = 10.4 / kFps;
  const auto collisions = [&](int seed, double up) {
    const auto position = [&](double t) -> Eigen::Vector3d {
      const Eigen::Vector3d change(0.1, 0.0, up);
      return Eigen::Vector3d(0.3 * t, 0.0, -0.5 * 9.81 * t * t) +
             std::max(0.0, t - kImpact) * change;
    };
    return fitTrajectory(measure(22, 0.004, 0.02, seed, position, still), {}, testPrior())
        .collisions.size();
  };
  size_t up = 0, down = 0, struck_down = 0;
  for (int seed = 1; seed <= 5; ++seed) {
    up += collisions(seed, 0.7);
    down += collisions(seed, -0.7);
    struck_down += collisions(seed, -1.5);
  }
  EXPECT_EQ(up, 5u);
  EXPECT_LE(down, 2u);
  EXPECT_EQ(struck_down, 5u);
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

// An object may be found wrongly as long as no motion is known. Key pose and one other are always
// explained by some velocity, and the rest then by an impact.
TEST(Trajectory, wrongPoseAfterTheKeyPoseIsNoImpactAtOnce) {
  constexpr double kSurprise = 16.27;  // chi-squared with 3 degrees of freedom, 99.9 %
  const Eigen::Vector3d v(1.3, 0.2, 0.2), wrong(0.05, 0.01, 0.005);
  int impacts = 0;
  for (int seed = 0; seed < 12; ++seed) {
    auto data = measure(
        40, 0.002, 0.01, seed, [&](double t) -> Eigen::Vector3d { return v * t; }, still);
    data[0].position.setZero();
    data[0].rotation = rotationFromVector(Eigen::Vector3d::Zero());
    data[0].covariance *= 1e-4;
    data[1].position -= wrong;
    const Trajectory fit = fitTrajectory(data, {}, testPrior());
    for (const Collision& impact : fit.collisions) EXPECT_GE(impact.time, data[2].time) << seed;
    impacts += fit.collisions.size();
    for (size_t k = 2; k < data.size(); ++k) {
      const Eigen::Vector3d error = fit.states[k].velocity - v;
      const Eigen::Matrix3d covariance = fit.states[k].twistCovariance().topLeftCorner<3, 3>();
      EXPECT_LT(error.dot(covariance.ldlt().solve(error)), kSurprise) << seed << ", frame " << k;
    }
  }
  EXPECT_LE(impacts, 3);  // a forced motion over three poses remains possible
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

// The method's published scatter for this motion: 0.3 px at 760 px and 1.1 m are 0.43 mm.
TEST(Trajectory, findsTheInstantOfCollisionWithinAFrame) {
  std::vector<double> errors;
  double surprise = 0.0;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> phase(0.0, 1.0);
  for (int i = 0; i < 20; ++i) {
    const double tc = (9.0 + phase(random)) / kFps;
    const auto data = measure(
        20, 0.00043, 0.005, 50 + i, [&](double t) { return bouncing(t, tc, 0.35); }, still);
    const Trajectory fit = fitTrajectory(data, {}, testPrior());
    ASSERT_EQ(fit.collisions.size(), 1u) << "repeat " << i;
    errors.push_back(kFps * std::abs(fit.collisions[0].time - tc));
    EXPECT_NEAR(fit.collisions[0].restitution(), 0.35, 0.05);
    surprise += std::pow((fit.collisions[0].restitution() - 0.35) /
                             fit.collisions[0].restitutionDeviation(),
                         2) /
                20.0;
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[10], 0.03);
  EXPECT_LT(errors[18], 0.1);
  // Chi-squared with 20 degrees of freedom over 20, from 1 % to 99 %: 0.41 to 1.88. Deviations are
  // stated rather too large.
  EXPECT_GT(surprise, 0.1);
  EXPECT_LT(surprise, 1.88);
}

// What lies where it fell has the restitution zero, and that as surely as a slow rebound would be
// seen: 0.43 mm over ten frames are 1.6 mm/s, of 2.9 m/s.
TEST(Trajectory, statesHowSurelyWhatFellDoesNotRebound) {
  const double tc = 9.3 / kFps;
  const Eigen::Vector3d floor = bouncing(tc, 10.0, 0.0);
  const auto data = measure(
      20, 0.00043, 0.005, 7, [&](double t) { return t < tc ? bouncing(t, 10.0, 0.0) : floor; },
      still);
  const Trajectory fit = fitTrajectory(data, {}, testPrior());
  ASSERT_EQ(fit.collisions.size(), 1u);
  const Collision& impact = fit.collisions.front();
  EXPECT_GT(impact.restitutionDeviation(), 1e-4);
  EXPECT_LT(impact.restitutionDeviation(), 0.01);
  EXPECT_NEAR(impact.restitution(), 0.0, 4.0 * impact.restitutionDeviation());
}

// Where any gain would do for a collision, only as many are told as are allowed.
TEST(Trajectory, tellsNoMoreCollisionsThanAllowed) {
  const auto zigzag = [](double t) {
    return Eigen::Vector3d(std::abs(std::fmod(2.0 * t, 1.0) - 0.5), 0.0, 0.0);
  };
  const auto data = measure(45, 0.001, 0.01, 10, zigzag, still);
  EXPECT_EQ(fitTrajectory(data, {}, testPrior()).collisions.size(), 5u);
  TrajectoryParams params;
  params.least_evidence = 0.0;
  params.max_collisions = 1;
  EXPECT_LE(fitTrajectory(data, {}, testPrior(), params).collisions.size(), 1u);
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

// Slides, is braked by friction and stays.
TEST(Trajectory, comingToRestIsNoImpact) {
  constexpr double kBraking = 1.2, kStart = 0.8;  // m/s^2, m/s
  const auto slide = [&](double t) {
    const double braked = std::min(t, kStart / kBraking);
    return Eigen::Vector3d(kStart * braked - 0.5 * kBraking * braked * braked, 0.0, 0.0);
  };
  const Trajectory trajectory =
      fitTrajectory(measure(36, 2e-4, 1e-3, 5, slide, still), {}, testPrior());
  EXPECT_TRUE(trajectory.collisions.empty());
  EXPECT_NEAR(trajectory.states[5].velocity.x(), kStart - kBraking * 5 / kFps, 0.02);
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
