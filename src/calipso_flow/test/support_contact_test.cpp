#include "../src/support_contact.hpp"

#include <gtest/gtest.h>

#include "calipso_flow/rotation.hpp"
#include "rendered_scene.hpp"

namespace calipso::flow {
namespace {

constexpr double kFps = 30.0;
const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

// A box of 0.4 m height falls upright from `height`, m, of its lower side, and stays where it
// comes down on z = 0.
std::vector<Observation> fall(double height, int frames) {
  std::vector<Observation> observations(frames);
  for (int k = 0; k < frames; ++k) {
    const double t = k / kFps;
    observations[k].time = t;
    observations[k].found = true;
    observations[k].world_from_object.translation().z() =
        0.2 + std::max(0.0, height - 0.5 * 9.81 * t * t);
    observations[k].covariance.diagonal().setConstant(1e-6);
  }
  return observations;
}

std::vector<PoseMeasurement> noted(const std::vector<SupportPlane>& planes,
                                   const std::vector<Observation>& observations) {
  auto measurements = measurementsOf(observations, Eigen::Vector3d::Zero());
  noteContacts(planes, test::boxModel(), observations, kGravity, measurements);
  return measurements;
}

TEST(SupportContact, strikesBetweenTheFramesAroundTheImpact) {
  // 0.3 m: 0.2473 s, 7.4 frames
  const auto measurements = noted({SupportPlane()}, fall(0.3, 12));
  for (int k = 1; k < 12; ++k) EXPECT_EQ(measurements[k].strikes > 0.0, k >= 8) << k;
  for (int k = 1; k <= 7; ++k) EXPECT_LT(measurements[k].strikes, 0.0) << k;
  for (int k = 0; k < 12; ++k) EXPECT_EQ(measurements[k].falls > 0.0, k <= 7) << k;
}

// 0.3 m takes 0.2473 s; a box that turns by 3 rad/s as it falls comes down on an edge, sooner.
TEST(SupportContact, tellsWhenAFallReachesThePlane) {
  for (const double spin : {0.0, 3.0}) {
    auto observations = fall(0.3, 8);
    for (Observation& o : observations)
      o.world_from_object.linear() = rotationFromVector({spin * o.time, 0.0, 0.0});
    const auto lowest = [&](double t) {
      const Eigen::Matrix3d turned = rotationFromVector({spin * t, 0.0, 0.0});
      return 0.5 - 0.5 * 9.81 * t * t +
             (test::boxModel().mesh.vertices * turned.transpose()).col(2).minCoeff();
    };
    double before = 0.2, after = 0.25;  // s
    while (after - before > 1e-6)
      (lowest(0.5 * (before + after)) > 0.0 ? before : after) = 0.5 * (before + after);
    observations.push_back(observations.back());
    observations.back().time = 8 / kFps;
    const auto measurements = noted({SupportPlane()}, observations);
    const int next = static_cast<int>(std::ceil(before * kFps));
    ASSERT_TRUE(measurements[next].contact) << spin;
    // Within a sixteenth of a frame it is taken for uniform: 9.81 m/s^2 (2 ms)^2 / 8 are 5 um.
    EXPECT_NEAR(measurements[next].contact->time, before, 1e-5) << spin;
    // A hundredth of the diagonal, at about 2.4 m/s.
    EXPECT_GT(measurements[next].contact->deviation, 1e-3) << spin;
    EXPECT_LT(measurements[next].contact->deviation, 1e-2) << spin;
    for (int k = 0; k < next; ++k) EXPECT_FALSE(measurements[k].contact) << k;
  }
}

TEST(SupportContact, nothingIsNotedWithoutAPlane) {
  for (const PoseMeasurement& m : noted({}, fall(0.3, 12))) {
    EXPECT_EQ(m.strikes, 0.0);
    EXPECT_EQ(m.falls, 0.0);
  }
}

TEST(SupportContact, aPlaneEndsWhereItsRangeDoes) {
  SupportPlane beside;
  beside.x_range = Eigen::Vector2d(1.0, 2.0);
  for (const PoseMeasurement& m : noted({beside}, fall(0.3, 12))) {
    EXPECT_LE(m.strikes, 0.0);
    EXPECT_GT(m.falls, 0.0);
  }
}

TEST(SupportContact, whatIsNotSeenTellsNothing) {
  auto observations = fall(0.3, 12);
  observations[3].found = false;
  const auto measurements = noted({SupportPlane()}, observations);
  EXPECT_EQ(measurements[3].falls, 0.0);
  EXPECT_EQ(measurements[3].strikes, 0.0);
  EXPECT_EQ(measurements[4].strikes, 0.0);
}

// The range ends within the body in frame 5 and begins again before frame 7: what comes over a
// step's edge in the air strikes nothing there.
TEST(SupportContact, whatCrossesTheEndOfAPlaneDoesNotStrikeIt) {
  SupportPlane step;
  step.x_range = Eigen::Vector2d(0.0, 20.0);
  auto observations = fall(0.0, 12);
  for (int k = 0; k < 12; ++k)
    observations[k].world_from_object.translation() = Eigen::Vector3d(0.6 * (k - 5.3), 0.0, 2.0);
  for (const PoseMeasurement& m : noted({step}, observations)) EXPECT_LE(m.strikes, 0.0) << m.time;
}

TEST(SupportContact, whatIsBelowAPlaneDoesNotTouchIt) {
  auto observations = fall(0.0, 6);
  for (Observation& o : observations) o.world_from_object.translation().z() = -0.5;
  const auto measurements = noted({SupportPlane()}, observations);
  EXPECT_EQ(measurements.size(), 6u);
  for (const PoseMeasurement& m : measurements) {
    EXPECT_LE(m.strikes, 0.0);
    EXPECT_GT(m.falls, 0.0);
  }
}

TEST(SupportContact, aPoseThatIsOnlyPredictedTouchesNothing) {
  auto observations = fall(0.3, 12);
  observations[3].found = false;
  observations[3].world_from_object.translation().z() = 0.1;  // in the plane
  const auto measurements = noted({SupportPlane()}, observations);
  EXPECT_EQ(measurements[3].strikes, 0.0);
  EXPECT_EQ(measurements[4].strikes, 0.0);
}

TEST(SupportContact, whatIsHeldDoesNotFall) {
  ObjectModel hung = test::boxModel();
  hung.attached = {0};
  const auto observations = fall(0.3, 6);
  auto measurements = measurementsOf(observations, Eigen::Vector3d::Zero());
  noteContacts({SupportPlane()}, hung, observations, kGravity, measurements);
  EXPECT_EQ(measurements.size(), 6u);
  for (const PoseMeasurement& m : measurements) EXPECT_EQ(m.falls, 0.0);
}

}  // namespace
}  // namespace calipso::flow
