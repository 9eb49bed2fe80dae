#include "ros/near_markers.hpp"

#include <algorithm>

#include "calipso_ros/conversions.hpp"

namespace calipso::bag {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kFar = 80.0, kNear = 1.0;  // m

double farthestPoint(const Marker& marker, const Eigen::Isometry3d& camera_from_world) {
  const Eigen::Isometry3d pose = camera_from_world * fromMsg(marker.pose);
  double farthest = pose.translation().norm();
  for (const geometry_msgs::Point& p : marker.points)
    farthest = std::max(farthest, (pose * Eigen::Vector3d(p.x, p.y, p.z)).norm());
  return farthest;
}

double farthestPoint(const MarkerArray& markers, const Eigen::Isometry3d& camera_from_world) {
  double farthest = 0.0;
  for (const Marker& marker : markers.markers)
    if (marker.action == Marker::ADD)
      farthest = std::max(farthest, farthestPoint(marker, camera_from_world));
  return farthest;
}

Marker shrunk(Marker marker, double factor, const Eigen::Isometry3d& camera_from_world) {
  Eigen::Isometry3d pose = camera_from_world * fromMsg(marker.pose);
  pose.translation() *= factor;
  marker.pose = toMsg(pose);
  marker.scale.x *= factor, marker.scale.y *= factor, marker.scale.z *= factor;
  if (marker.type == Marker::TRIANGLE_LIST) return marker;  // its scale is that of its points
  for (geometry_msgs::Point& p : marker.points) p.x *= factor, p.y *= factor, p.z *= factor;
  return marker;
}

}  // namespace

MarkerArray nearMarkers(const MarkerArray& markers, const Eigen::Isometry3d& camera_from_world,
                        const std::string& camera_frame) {
  const double farthest = farthestPoint(markers, camera_from_world);
  MarkerArray near;
  Marker clear;
  clear.action = Marker::DELETEALL;
  near.markers.push_back(clear);
  if (farthest > kFar)
    for (const Marker& marker : markers.markers)
      if (marker.action == Marker::ADD)
        near.markers.push_back(shrunk(marker, kNear / farthest, camera_from_world));
  for (Marker& marker : near.markers) {
    if (!markers.markers.empty()) marker.header.stamp = markers.markers.front().header.stamp;
    marker.header.frame_id = camera_frame;
  }
  return near;
}

}  // namespace calipso::bag
