#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "calipso_flow/rotation.hpp"
#include "calipso_flow/trajectory.hpp"
#include "measured_motion.hpp"

namespace calipso::flow {
namespace {

using namespace test;

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

// Lost in the second frame after the impact: where the floor is says when it struck, and so how
// fast the one pose shows it come back.
TEST(Trajectory, onePoseAfterAnImpactTellsTheReboundWhereTheFloorIsKnown) {
  constexpr double kImpact = 8.2 / kFps, kRestitution = 0.3;
  auto poses = measure(
      14, 5e-4, 2e-3, 3, [&](double t) { return bouncing(t, kImpact, kRestitution); }, still);
  for (size_t k = 10; k < poses.size(); ++k) poses[k].valid = false;
  poses[9].contact = PoseMeasurement::Instant{kImpact, 1e-3};
  poses[9].strikes = 4.0;
  const Trajectory trajectory = fitTrajectory(poses, {}, testPrior());
  ASSERT_EQ(trajectory.collisions.size(), 1u);
  EXPECT_NEAR(trajectory.collisions[0].time, kImpact, 2e-3);
  // 0.8 of a frame after the impact 0.5 mm are 0.02 m/s, a ms of the fall's 2.7 m/s is 0.1 m/s.
  EXPECT_NEAR(trajectory.collisions[0].restitution(), kRestitution, 0.1);
}

// Which instants the floor speaks of depends on the poses after each, not on those after the guess
// that the search sets out from: here before the last pose of the fall.
TEST(Trajectory, theFloorTellsTheInstantOfAnImpactJustAfterAPose) {
  constexpr double kImpact = 8.05 / kFps;
  for (const int seed : {4, 10}) {
    auto poses = measure(
        16, 3e-3, 1e-2, seed, [&](double t) { return bouncing(t, kImpact, 0.3); }, still);
    for (size_t k = 11; k < poses.size(); ++k) poses[k].valid = false;
    poses[9].contact = PoseMeasurement::Instant{kImpact, 1e-3};
    poses[9].strikes = 4.0;
    const Trajectory trajectory = fitTrajectory(poses, {}, testPrior());
    ASSERT_EQ(trajectory.collisions.size(), 1u) << seed;
    EXPECT_NEAR(trajectory.collisions[0].time, kImpact, 2e-3) << seed;  // two deviations
  }
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

}  // namespace
}  // namespace calipso::flow
