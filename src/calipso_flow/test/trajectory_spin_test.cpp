#include <gtest/gtest.h>

#include "calipso_flow/rotation.hpp"
#include "calipso_flow/trajectory.hpp"

namespace calipso::flow {
namespace {

// Poses that are right, but stated to be uncertain in turns and, hanging together with these,
// across the fall: no spin stands out. Were it taken for none, what the body turns by would be
// taken for an error of its poses and put its velocity off, too.
TEST(Trajectory, whatFallsMayTurnSlowly) {
  const double turn_deviation = 0.05, deviation = 3e-3, correlation = 0.9;
  const Eigen::Vector3d velocity(0.3, 0.1, 0.5), spin(0.0, 0.2, 0.0);
  const MotionPrior prior;
  std::vector<PoseMeasurement> poses(9);
  for (size_t k = 0; k < poses.size(); ++k) {
    const double t = k / 30.0;
    poses[k].time = t;
    poses[k].valid = true;
    poses[k].position = velocity * t + 0.5 * t * t * prior.gravity;
    poses[k].rotation = rotationFromVector(spin * t);
    poses[k].covariance.setZero();
    poses[k].covariance.diagonal() << Eigen::Vector3d::Constant(deviation * deviation),
        Eigen::Vector3d::Constant(turn_deviation * turn_deviation);
    poses[k].covariance(0, 4) = poses[k].covariance(4, 0) =
        correlation * deviation * turn_deviation;
  }
  const Trajectory trajectory = fitTrajectory(poses, {}, prior);
  ASSERT_EQ(trajectory.pieces.size(), 1u);
  EXPECT_EQ(trajectory.pieces.front().travel, Travel::kFreeFall);
  const MotionState& first = trajectory.states.front();
  // the priors of velocity and spin draw towards zero by less than this
  EXPECT_NEAR((first.spin - spin).norm(), 0.0, 1e-2);
  EXPECT_NEAR((first.velocity - velocity).norm(), 0.0, 1e-2);
}

}  // namespace
}  // namespace calipso::flow
