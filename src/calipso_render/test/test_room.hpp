#pragma once

#include <algorithm>
#include <vector>

#include "place/place_relief.hpp"

// A floor, a wall, and an object before the edge between them.
namespace calipso::render::testing {

constexpr int kWide = 160, kHigh = 120;
constexpr float kWallAway = 3.0f;  // m, along y
const cv::Rect kObject(60, 40, 40, 60);  // across the edge between floor and wall
constexpr float kObjectAway = 2.0f;
// Towards it, world.
inline const Eigen::Vector3f kSun = Eigen::Vector3f(-0.3f, -0.6f, 0.7f).normalized();

// 1 m over the floor z = 0, looking along y.
inline Camera roomCamera() {
  Camera c;
  c.width = kWide, c.height = kHigh, c.fx = c.fy = 120.0, c.cx = 79.5, c.cy = 59.5;
  Eigen::Matrix3d R;
  R.col(0) = Eigen::Vector3d::UnitX(), R.col(1) = -Eigen::Vector3d::UnitZ(),
  R.col(2) = Eigen::Vector3d::UnitY();
  c.world_from_camera.linear() = R,
  c.world_from_camera.translation() = Eigen::Vector3d(0.0, 0.0, 1.0);
  return c;
}

inline std::vector<SupportPlane> floorPlane() {
  SupportPlane plane;
  plane.normal = Eigen::Vector3d::UnitZ(), plane.offset = 0.0;
  return {plane};
}

inline bool isWall(int v) {
  return static_cast<float>(roomCamera().ray(0, v).y()) * kWallAway < 1.0f;
}

struct Room {
  cv::Mat depth = cv::Mat(kHigh, kWide, CV_32F), scenery = depth.clone(),
          labels = cv::Mat::zeros(kHigh, kWide, CV_8U);

  Room() {
    for (int v = 0; v < kHigh; ++v) {
      const float floor = 1.0f / std::max(1e-6f, static_cast<float>(roomCamera().ray(0, v).y()));
      depth.row(v) = isWall(v) ? kWallAway : floor;
    }
    scenery = 1.0f / depth;
    depth(kObject) = kObjectAway, scenery(kObject) = 0.0f, labels(kObject) = 1;
  }
  PlaceSurfaces surfaces() const {
    return findSurfaces(scenery, depth, labels, floorPlane(), roomCamera());
  }
};

}  // namespace calipso::render::testing
