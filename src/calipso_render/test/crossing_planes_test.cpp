// Support planes that pass through walls, rims, and how near what is invented is.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

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

// A picture hangs on a wall; a screen stands to the left, nearly as near as the picture.
TEST(CrossingPlanes, WhatHangsOnASupportPlaneIsNotPartOfWhatStandsBesideIt) {
  Room room;
  const auto show = [&](const cv::Rect& where, float away) {
    room.depth(where) = away, room.scenery(where) = 1.0f / away;
  };
  const cv::Rect screen(4, 4, 40, 60), picture(110, 10, 30, 40);
  show(screen, 0.973f * kWallAway), show(picture, 0.981f * kWallAway);
  std::vector<SupportPlane> planes = floorPlane();
  planes.push_back(planes.front());
  planes.back().normal = -Eigen::Vector3d::UnitY(), planes.back().offset = -kWallAway;
  const PlaceSurfaces surfaces =
      findSurfaces(room.scenery, room.depth, room.labels, planes, roomCamera());
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(30, 20), 3);
  EXPECT_EQ(cv::countNonZero(surfaces.label(picture) != 2), 0);
  // Behind the object, between the two, farther from the screen than that may go on.
  EXPECT_EQ(cv::countNonZero(surfaces.label(cv::Rect(88, 40, 12, 20)) != 2), 0);
}

// The scenery leaves the outermost pixels of a block to the floor and wall behind it.
TEST(PlaceRelief, TheOutermostPixelsOfWhatStandsOutAreItsOwn) {
  Room room;
  const cv::Rect block(110, 30, 30, 40), around(106, 26, 38, 48);
  room.depth(block) = 1.5f;
  room.labels(kObject) = 0, room.depth(kObject) = 1.5f;
  cv::Mat(1.0f / room.depth).copyTo(room.scenery);
  cv::erode(room.scenery, room.scenery, cv::Mat::ones(3, 3, CV_8U));
  Relief relief = findRelief(room.surfaces(), -Eigen::Vector3f::UnitY());
  const int number = relief.wall.at<std::uint8_t>(50, 125);
  addRims(room.scenery, room.depth, relief);
  for (int v = around.y; v < around.br().y; ++v) {
    for (int u = around.x; u < around.br().x; ++u) {
      const bool on_block = block.contains({u, v});
      ASSERT_EQ(relief.at(u, v) && relief.wall.at<std::uint8_t>(v, u) == number, on_block)
          << u << ", " << v;
      if (on_block) {
        EXPECT_NEAR(relief.receiver(u, v).position.y(), 1.5f, 0.02f) << u << ", " << v;
      }
    }
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
