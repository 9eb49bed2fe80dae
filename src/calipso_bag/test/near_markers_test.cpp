#include "ros/near_markers.hpp"

#include <gtest/gtest.h>

#include "calipso_ros/conversions.hpp"

namespace calipso::bag {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

// Looks along +y from 10 m above the origin.
Eigen::Isometry3d cameraFromWorld() {
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
  camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  camera.translation() = Eigen::Vector3d(0.0, 0.0, 10.0);
  return camera.inverse();
}

MarkerArray clearThen(int type, const std::vector<Eigen::Vector3d>& points) {
  MarkerArray array;
  array.markers.resize(2);
  array.markers[0].action = Marker::DELETEALL;
  Marker& m = array.markers[1];
  m.header.frame_id = "map";
  m.header.stamp = array.markers[0].header.stamp = ros::Time(7.0);
  m.type = type;
  m.pose.orientation.w = 1.0;
  m.scale.x = m.scale.y = m.scale.z = 1.0;
  for (const Eigen::Vector3d& p : points) m.points.push_back(toPointMsg(p));
  return array;
}

// Where rviz draws a point of a marker, in the marker's frame.
Eigen::Vector3d drawn(const Marker& m, int k) {
  const double scale = m.type == Marker::TRIANGLE_LIST ? m.scale.x : 1.0;
  const auto& p = m.points.at(k);
  return fromMsg(m.pose) * (scale * Eigen::Vector3d(p.x, p.y, p.z));
}

TEST(NearMarkers, FarOnesAreSeenInTheSameDirectionsAndNear) {
  const std::vector<Eigen::Vector3d> points = {{0, 250, 0}, {30, 300, 5}, {-20, 200, 60}};
  for (const int type : {Marker::TRIANGLE_LIST, Marker::SPHERE_LIST, Marker::LINE_STRIP}) {
    const MarkerArray near = nearMarkers(clearThen(type, points), cameraFromWorld(), "eye");
    ASSERT_EQ(near.markers.size(), 2u);
    EXPECT_EQ(near.markers[0].action, Marker::DELETEALL);
    const Marker& m = near.markers[1];
    EXPECT_EQ(m.header.frame_id, "eye");
    EXPECT_EQ(m.header.stamp, ros::Time(7.0));
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d at = drawn(m, k), was = cameraFromWorld() * points[k];
      EXPECT_LT(at.norm(), 1.0 + 1e-9);
      EXPECT_GT(at.norm(), 0.1);
      EXPECT_NEAR(at.normalized().dot(was.normalized()), 1.0, 1e-12);
      EXPECT_NEAR(m.scale.x, at.norm() / was.norm(), 1e-12);
    }
  }
}

TEST(NearMarkers, WhatRvizSeesAnywayIsNotGivenTwice) {
  const MarkerArray near =
      nearMarkers(clearThen(Marker::TRIANGLE_LIST, {{0, 5, 0}, {1, 5, 0}, {0, 5, 1}}),
                  cameraFromWorld(), "eye");
  ASSERT_EQ(near.markers.size(), 1u);
  EXPECT_EQ(near.markers[0].action, Marker::DELETEALL);
}

TEST(NearMarkers, ABoxKeepsItsApparentSize) {
  MarkerArray array = clearThen(Marker::CUBE, {});
  array.markers[1].pose.position.y = 500.0;
  array.markers[1].pose.position.z = 10.0;
  array.markers[1].scale.x = 50.0;
  const Marker m = nearMarkers(array, cameraFromWorld(), "eye").markers.at(1);
  EXPECT_NEAR(m.pose.position.z, 1.0, 1e-12);
  EXPECT_NEAR(m.scale.x, 0.1, 1e-12);
}

}  // namespace
}  // namespace calipso::bag
