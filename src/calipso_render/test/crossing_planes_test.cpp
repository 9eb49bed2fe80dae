// Support planes that pass through walls, and how near what is invented is.

#include <gtest/gtest.h>

#include "test_room.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A table ends before a wall; its plane, gone on, would pass through the wall 33 rows farther up.
TEST(CrossingPlanes, AWallStaysOneWhereASupportPlaneWouldPassThroughIt) {
  constexpr float kTableEnds = 1.8f;
  Room room;
  const auto isTable = [](int v) {
    return static_cast<float>(roomCamera().ray(0, v).y()) * kTableEnds >= 1.0f;
  };
  for (int v = 0; v < kHigh; ++v) {
    if (isTable(v)) continue;
    room.depth.row(v) = kWallAway;
    room.scenery.row(v) = 1.0f / kWallAway;
  }
  room.depth(kObject) = 1.2f, room.scenery(kObject) = 0.0f;
  const PlaceSurfaces surfaces = room.surfaces();
  for (int v = 0; v < kHigh; ++v) {
    if (isTable(v - 1) != isTable(v + 1)) continue;
    for (int u = 0; u < kWide; ++u)
      ASSERT_EQ(surfaces.label.at<std::uint8_t>(v, u), isTable(v) ? 1 : 2) << u << ", " << v;
  }
}

TEST(FollowPlanes, WhatIsInventedIsAsNearAsItsPlane) {
  const Room room;
  const PlaceSurfaces surfaces = room.surfaces();
  cv::Mat nearness(kHigh, kWide, CV_32F, cv::Scalar(7.0f)),
      invented = cv::Mat::zeros(kHigh, kWide, CV_8U);
  invented(kObject).setTo(255);
  followPlanes(surfaces, invented, nearness);
  EXPECT_NEAR(nearness.at<float>(45, 80), 1.0f / kWallAway, 1e-3f);
  EXPECT_EQ(nearness.at<float>(45, 20), 7.0f);
}

}  // namespace
}  // namespace calipso::render
