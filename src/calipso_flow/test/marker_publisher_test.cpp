#include "ros/marker_publisher.hpp"

#include <gtest/gtest.h>

namespace calipso::flow {
namespace {

using visualization_msgs::Marker;

// An object of one frame that moves so fast.
ObjectDynamics movingWith(const Eigen::Vector3d& velocity, double diagonal) {
  ObjectDynamics object;
  object.name = "thing";
  object.diagonal = diagonal;
  object.motions.resize(1);
  object.motions[0].state.velocity = velocity;
  object.observations.resize(1);
  return object;
}

Marker velocityOf(const ObjectDynamics& object) {
  for (const Marker& m : markersOf(object, 0, {}).markers)
    if (m.ns == "thing/velocity") return m;
  return {};
}

// rviz draws an arrow that is shorter than its head the wrong way round.
TEST(FlowMarkers, AnArrowIsLongerThanItsHeadOrTakenAway) {
  for (const double diagonal : {0.05, 50.0}) {
    EXPECT_EQ(velocityOf(movingWith(Eigen::Vector3d::Zero(), diagonal)).action, Marker::DELETE);
    for (const double speed : {0.02, 0.2, 1.0, 10.0}) {
      const Marker m = velocityOf(movingWith({0.0, 0.0, 10.0 * speed * diagonal}, diagonal));
      EXPECT_EQ(m.action, Marker::ADD) << speed;
      EXPECT_NEAR(m.points.at(1).z - m.points.at(0).z, speed * diagonal, 1e-9 * diagonal);
      EXPECT_LT(m.scale.z, speed * diagonal);
      EXPECT_GT(m.scale.x, 0.0);
      EXPECT_LT(m.scale.x, 0.1 * diagonal);
    }
  }
}

}  // namespace
}  // namespace calipso::flow
