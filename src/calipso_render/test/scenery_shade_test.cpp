#include "place/scenery_shade.hpp"

#include <gtest/gtest.h>

#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

// A screen that stands upright on the floor z = 0, and the floor around, seen from 1 m above it.
struct Room {
  static constexpr float kAway = 4.0f, kHalf = 0.5f, kHigh = 0.6f;  // m
  Camera camera;
  SupportPlane floor;
  cv::Mat depth, labels;

  Room() {
    camera.width = 160, camera.height = 120, camera.fx = camera.fy = 120.0;
    camera.cx = 79.5, camera.cy = 59.5;
    Eigen::Matrix3d R;
    R.col(0) = Eigen::Vector3d::UnitX(), R.col(1) = -Eigen::Vector3d::UnitZ(),
    R.col(2) = Eigen::Vector3d::UnitY();
    camera.world_from_camera.linear() = R;
    camera.world_from_camera.translation() = Eigen::Vector3d(0.0, 0.0, 1.0);
    depth = cv::Mat::zeros(camera.height, camera.width, CV_32F),
    labels = cv::Mat::zeros(depth.size(), CV_8U);
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        const Eigen::Vector3d ray = camera.ray(u, v), on = kAway * ray;
        const double below = 1.0 - on.y();
        if (std::abs(on.x()) < kHalf && below > 0.0 && below < kHigh)
          depth.at<float>(v, u) = kAway;
        else if (ray.y() > 0.05)
          depth.at<float>(v, u) = static_cast<float>(1.0 / ray.y());
      }
    }
  }
  cv::Mat shade(const Eigen::Vector3f& to_sun) const {
    cv::Mat scenery = 1.0f / depth;
    scenery.setTo(0.0f, depth == 0.0f);
    const PlaceSurfaces surfaces = findSurfaces(scenery, depth, labels, {floor}, camera);
    return shadeOfScenery(scenery, surfaces, camera, to_sun.normalized(),
                          [&](int u, int v) { return receiverAt({floor}, camera, u, v); });
  }
  cv::Point pixelOf(double x, double y) const {
    const Eigen::Vector2d p = camera.projectWorld({x, y, 0.0});
    return {cvRound(p.x()), cvRound(p.y())};
  }
};

TEST(ShadeOfScenery, LiesWhereItStandsBeforeTheSun) {
  const Room room;
  const cv::Mat shade = room.shade({0.0f, 1.0f, 0.5f});  // 1.2 m long, towards the camera
  ASSERT_FALSE(shade.empty());
  for (const double y : {3.1, 3.4, 3.6}) {
    EXPECT_NE(shade.at<std::uint8_t>(room.pixelOf(0.0, y)), 0) << y;
    EXPECT_NE(shade.at<std::uint8_t>(room.pixelOf(0.4, y)), 0) << y;
    EXPECT_EQ(shade.at<std::uint8_t>(room.pixelOf(0.7, y)), 0) << y;
  }
  EXPECT_EQ(shade.at<std::uint8_t>(room.pixelOf(0.0, 2.6)), 0);
}

TEST(ShadeOfScenery, LiesOnTheOtherSideUnderTheOtherSun) {
  const cv::Mat shade = Room().shade({0.0f, -1.0f, 0.5f});
  EXPECT_TRUE(shade.empty() || shade.at<std::uint8_t>(Room().pixelOf(0.0, 3.5)) == 0);
}

TEST(ShadeOfScenery, IsNoneWhereNothingRises) {
  Room room;
  room.depth.setTo(0.0f);
  EXPECT_TRUE(room.shade({0.0f, 1.0f, 0.5f}).empty());
}

}  // namespace
}  // namespace calipso::render
