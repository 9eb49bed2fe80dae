#include "place/place_relief.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "place/place_view.hpp"
#include "place/plane_reach.hpp"
#include "place/relief_sky.hpp"
#include "test_room.hpp"

namespace calipso::render {
namespace {

using namespace testing;

TEST(PlaceRelief, AWallGoesOnBehindAnObjectAndMeetsTheFloorThere) {
  const PlaceSurfaces surfaces = Room().surfaces();
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      const double edge = std::abs(roomCamera().ray(u, v).y() * kWallAway - 1.0);
      if (edge < 0.01) continue;
      ASSERT_EQ(surfaces.label.at<std::uint8_t>(v, u), isWall(v) ? 2 : 1) << u << ", " << v;
    }
  }
  const Relief relief = findRelief(surfaces, kSun);
  const Receiver behind = relief.receiver(80, 45);
  EXPECT_NEAR(behind.position.y(), kWallAway, 1e-3);
  EXPECT_NEAR((behind.normal - Eigen::Vector3f(0, -1, 0)).norm(), 0.0, 1e-3);
}

// A block on the floor, its front at y = 1.702 and its top at z = 0.5, an object before the edge between both.
TEST(PlaceRelief, TheSidesOfABlockEndAtItsEdge) {
  Room room;
  const auto isTop = [](double down) { return down * 1.702 < 0.5; };
  for (int v = 0; v < kHigh; ++v) {
    const double down = roomCamera().ray(0, v).y();
    const double front = 1.702, top = 0.5 / std::max(down, 1e-6);
    if (top > 3.0) continue;  // the wall behind
    const double near = isTop(down) ? top : std::min(front, 1.0 / down);
    room.depth.row(v) = near, room.scenery.row(v) = 1.0 / near;
  }
  const int edge = static_cast<int>(59.5 + 120.0 * 0.5 / 1.702);  // row
  const cv::Rect object(60, edge - 8, 40, 20);
  room.labels.setTo(0), room.labels(object).setTo(1);
  room.depth(object).setTo(1.2), room.scenery(object).setTo(0.0);
  const PlaceSurfaces surfaces = room.surfaces();
  const int top = surfaces.label.at<std::uint8_t>(edge - 4, 20),
            front = surfaces.label.at<std::uint8_t>(edge + 4, 20);
  ASSERT_NE(top, front);
  for (int v = object.y; v < object.br().y; ++v) {
    for (int u = object.x; u < object.br().x; ++u) {
      ASSERT_EQ(surfaces.label.at<std::uint8_t>(v, u), v <= edge ? top : front) << u << ", " << v;
      ASSERT_NE(surfaces.sure.at<std::uint8_t>(v, u), 0);
    }
  }
}

// Depth images are taken as near as all of a pixel's surroundings; towards the horizon that is a
// row farther off, and much.
TEST(PlaceRelief, AFloorUpToTheHorizonIsNoPlaneOfItsOwn) {
  Room room;
  for (int v = 0; v < kHigh; ++v) {
    const float down = std::max(0.0f, static_cast<float>(roomCamera().ray(0, v).y()));
    room.scenery.row(v) = down, room.depth.row(v) = down > 0.0f ? 1.0f / down : 0.0f;
  }
  cv::erode(room.scenery, room.scenery, cv::Mat::ones(3, 3, CV_8U));
  room.scenery(kObject) = 0.0f, room.labels(kObject) = 1;
  const PlaceSurfaces surfaces = room.surfaces();
  EXPECT_EQ(cv::countNonZero(surfaces.label > 1), 0);
  EXPECT_TRUE(findRelief(surfaces, kSun).empty());
}

// Behind an object that stands on it, too.
TEST(PlaceRelief, AFloorUpToTheHorizonGoesOnBehindAnObject) {
  Room room;
  for (int v = 0; v < kHigh; ++v) {
    const float down = std::max(0.0f, static_cast<float>(roomCamera().ray(0, v).y()));
    room.scenery.row(v) = down, room.depth.row(v) = down > 0.0f ? 1.0f / down : 0.0f;
  }
  cv::erode(room.scenery, room.scenery, cv::Mat::ones(3, 3, CV_8U));
  const cv::Rect object(70, 55, 20, 30);
  room.scenery(object) = 0.0f, room.labels.setTo(0), room.labels(object) = 1;
  room.depth(object) = 2.0f;
  const PlaceSurfaces surfaces = room.surfaces();
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(70, 80), 1);
  EXPECT_EQ(surfaces.alike.at<std::uint8_t>(83, 80), 1);
  // Up to 20 rows below the horizon something may stand before it.
  EXPECT_EQ(surfaces.alike.at<std::uint8_t>(70, 80), PlaceSurfaces::kUnknown);
}

TEST(PlaceRelief, OffTheSupportsWallsStaySure) {
  const PlaceSurfaces surfaces = Room().surfaces();
  const cv::Mat sure = surfaces.sureOffSupports();
  EXPECT_EQ(cv::countNonZero(sure != (surfaces.sure & (surfaces.label != 1))), 0);
  EXPECT_GT(cv::countNonZero(sure(kObject)), 0);
  EXPECT_LT(cv::countNonZero(sure), cv::countNonZero(surfaces.sure));
}

// A bank that bends up from the water, and a bridge before both.
TEST(PlaceRelief, APlaneIsLeftToWhatRisesAboveIt) {
  Room room;
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      const float floor = std::max(0.05f, static_cast<float>(roomCamera().ray(0, v).y()));
      const float x = static_cast<float>(std::max(0, u - 90)) / 40.0f;
      const float bumps = 1.0f + 0.3f * std::sin(0.5f * v) * std::sin(0.4f * u);
      room.scenery.at<float>(v, u) = floor + 0.3f * x * x * bumps;
    }
  }
  room.depth = 1.0f / room.scenery;
  const cv::Rect bridge(0, 84, kWide, 16);
  room.scenery(bridge) = 0.0f, room.labels.setTo(0), room.labels(bridge) = 1;
  room.depth(bridge) = 0.5f;
  const PlaceSurfaces surfaces = room.surfaces();
  ASSERT_EQ(surfaces.label.at<std::uint8_t>(110, 140), PlaceSurfaces::kCurved);
  EXPECT_EQ(surfaces.alike.at<std::uint8_t>(92, 30), 1);
  EXPECT_EQ(surfaces.alike.at<std::uint8_t>(92, 140), PlaceSurfaces::kCurved);
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(92, 140), PlaceSurfaces::kUnknown);
}

// A pillar with a rough face, 4 m away, before whose foot an object is.
TEST(PlaceRelief, WhatStandsOnAPlaneEndsThere) {
  Room room;
  for (int v = 40; v < 90; ++v) {
    for (int u = 60; u < 95; ++u)
      room.scenery.at<float>(v, u) =
          0.25f * (1.1f + 0.1f * std::sin(0.5f * v) * std::sin(0.4f * u));
  }
  room.depth = 1.0f / room.scenery;
  const cv::Rect object(40, 76, 75, 44);
  room.scenery(object) = 0.0f, room.labels.setTo(0), room.labels(object) = 1;
  room.depth(object) = 1.5f;
  const PlaceSurfaces surfaces = room.surfaces();
  ASSERT_EQ(surfaces.label.at<std::uint8_t>(70, 78), PlaceSurfaces::kCurved);
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(80, 78), PlaceSurfaces::kUnknown);
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(94, 78), 1);  // nearer than the pillar is its floor
}

// A rough bowl of which little is seen, but on all sides of what lies in it.
TEST(PlaceRelief, APlaneIsNotSeenWithinWhatStandsOnIt) {
  Room room;
  const cv::Rect bowl(50, 70, 60, 36), object(54, 74, 52, 28);
  for (int v = bowl.y; v < bowl.br().y; ++v) {
    for (int u = bowl.x; u < bowl.br().x; ++u)
      room.scenery.at<float>(v, u) = static_cast<float>(roomCamera().ray(0, v).y()) + 0.12f +
                                     0.08f * std::sin(0.9f * v) * std::sin(0.8f * u);
  }
  room.depth = 1.0f / room.scenery;
  room.scenery(object) = 0.0f, room.labels.setTo(0), room.labels(object) = 1;
  room.depth(object) = 1.5f;
  const PlaceSurfaces surfaces = room.surfaces();
  EXPECT_EQ(cv::countNonZero(surfaces.label(object) == 1), 0);
}

// A bush before an object says nothing of what is behind that.
TEST(PlaceRelief, APlaneGoesOnBehindAnObjectThatABushStandsBefore) {
  Room room;
  const cv::Rect object(60, 62, 40, 32), bush(64, 84, 32, 20);
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      room.scenery.at<float>(v, u) =
          bush.contains({u, v}) ? 0.4f + 0.04f * std::sin(0.9f * v) * std::sin(0.8f * u)
                                : std::max(0.02f, static_cast<float>(roomCamera().ray(0, v).y()));
    }
  }
  room.depth = 1.0f / room.scenery, room.labels.setTo(0);
  for (int v = object.y; v < bush.y; ++v) {
    for (int u = object.x; u < object.br().x; ++u)
      room.scenery.at<float>(v, u) = 0.0f, room.depth.at<float>(v, u) = 3.3f,
                                room.labels.at<std::uint8_t>(v, u) = 1;
  }
  const PlaceSurfaces surfaces = room.surfaces();
  ASSERT_EQ(surfaces.label.at<std::uint8_t>(94, 80), PlaceSurfaces::kCurved);
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(80, 80), 1);
}

TEST(PlaceRelief, ASupportPlaneIsNotSeenBeyondItsEnds) {
  const Room room;
  std::vector<SupportPlane> planes = floorPlane();
  planes.push_back(planes.front());
  planes.back().offset = 0.4, planes.back().x_range = Eigen::Vector2d(-0.3, 0.3);
  const PlaceSurfaces surfaces =
      findSurfaces(room.scenery, room.depth, room.labels, planes, roomCamera());
  EXPECT_EQ(cv::countNonZero(surfaces.label == 2), 0);
}

TEST(PlaneReach, WhatMeetsAPlaneThatGoesOnDoesSoAsWell) {
  cv::Mat plane(kHigh, kWide, CV_32F, cv::Scalar(0.5f)),
      scenery = plane.clone(), none = cv::Mat::zeros(kHigh, kWide, CV_8U), edge = none.clone();
  scenery.colRange(120, kWide).setTo(0.2f);  // farther
  scenery.colRange(20, 120).setTo(0.0f);     // hidden
  edge(cv::Rect(20, 60, 90, 1)).setTo(255);
  const auto reaches = [&](const cv::Mat& at) {
    return goesOn(plane, plane, scenery, none, none, at, none).at<std::uint8_t>(63, 100) != 0;
  };
  EXPECT_FALSE(reaches(none));
  EXPECT_TRUE(reaches(edge));
}

TEST(PlaceRelief, IsNoneWhereNothingStandsAndWhereWhatIsCurvedTurnsAway) {
  EXPECT_TRUE(
      findRelief(findSurfaces(cv::Mat(), cv::Mat(), Room().labels, floorPlane(), roomCamera()),
                 kSun)
          .empty());
  PlaceSurfaces surfaces = Room().surfaces();
  surfaces.label.setTo(PlaceSurfaces::kCurved, surfaces.label == 2);
  EXPECT_FALSE(findRelief(surfaces, kSun).empty());
  EXPECT_TRUE(findRelief(surfaces, Eigen::Vector3f(0.0f, 0.6f, 0.8f)).empty());
}

TEST(PlaceRelief, WhatIsBehindAnObjectIsNotBeforeIt) {
  Room room;
  room.depth(kObject) = 3.5f;  // seen through a hole in the wall
  const PlaceSurfaces surfaces = room.surfaces();
  EXPECT_EQ(surfaces.label.at<std::uint8_t>(45, 80),
            PlaceSurfaces::kUnknown);  // above the floor's horizon
}

TEST(PlaceRelief, APlaneDoesNotGoOnBetweenItsPiecesWhereSomethingFartherIsSeen) {
  // of the wall two pieces are left, 5 m behind it is another one; an object stands before all of
  // them
  Room room;
  const cv::Rect gap(40, 0, 80, kHigh), object(0, 20, kWide, 10);
  for (int v = 0; v < kHigh; ++v) {
    for (int u = gap.x; u < gap.br().x; ++u)
      room.depth.at<float>(v, u) = std::min(8.0f, room.depth.at<float>(v, u) == kObjectAway ? 8.0f
                                                  : isWall(v)                               ? 8.0f
                                                              : kWallAway);
  }
  room.labels = 0, room.labels(object) = 1;
  room.scenery = 1.0f / room.depth;
  room.scenery(object) = 0.0f, room.depth(object) = kObjectAway;
  const PlaceSurfaces surfaces = room.surfaces();
  const auto labelAt = [&](int u) { return surfaces.label.at<std::uint8_t>(25, u); };
  EXPECT_NE(labelAt(20), labelAt(80));
  EXPECT_EQ(labelAt(20), labelAt(140));
  EXPECT_EQ(labelAt(80), surfaces.label.at<std::uint8_t>(10, 80));
}

TEST(PlaceRelief, DepthNoiseMovesAWallLittle) {
  Room room;
  cv::Mat noise(room.depth.size(), CV_32F);
  cv::RNG random(3);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 0.003);
  room.depth = room.depth.mul(1.0f + noise);
  cv::Mat(1.0 / room.depth).copyTo(room.scenery, room.labels == 0);
  const Relief relief = findRelief(room.surfaces(), kSun);
  ASSERT_TRUE(relief.at(80, 45));
  EXPECT_NEAR(relief.receiver(80, 45).position.y(), kWallAway, 0.01);
  EXPECT_GT(-relief.receiver(80, 45).normal.y(), 0.999f);
}

// In the sun's absence nothing but the sky lights them.
TEST(PlaceRelief, WallsThatTurnAwayTakeTheSkysShadeAlone) {
  const Eigen::Vector3f behind = Eigen::Vector3f(0.0f, 0.7f, 0.7f).normalized();
  const Relief relief = findRelief(Room().surfaces(), behind);
  ASSERT_EQ(relief.walls.size(), 1u);
  EXPECT_NEAR((relief.walls[0].normal - Eigen::Vector3f(0, -1, 0)).norm(), 0.0, 1e-3);
  EXPECT_EQ(turnedAway(relief, behind).at<std::uint8_t>(25, 20), 255);
  EXPECT_EQ(cv::countNonZero(turnedAway(findRelief(Room().surfaces(), kSun), kSun)), 0);
}

TEST(ReliefSky, IsHiddenFromAWallByWhatIsNearItAlone) {
  const Relief relief = findRelief(Room().surfaces(), kSun);
  const auto seenAt = [&](float away, int u) {  // past a board, 30 cm wide and high
    const Points board = {
        {-0.15f, away, 0.85f}, {0.15f, away, 0.85f}, {0.15f, away, 1.15f}, {-0.15f, away, 1.15f}};
    const Triangles triangles = {{0, 1, 2}, {0, 2, 3}};
    return ReliefSky(relief, {{&board, &triangles}}, 128).at(u, 59);
  };
  const int middle = 80;
  EXPECT_LT(seenAt(kWallAway - 0.03f, middle), 0.1f);
  EXPECT_NEAR(seenAt(kWallAway - 0.03f, middle + 6), 0.5f, 0.3f);  // below its side
  EXPECT_EQ(seenAt(kWallAway - 0.03f, middle + 20), 1.0f);
  EXPECT_EQ(seenAt(kWallAway - 0.3f, middle), 1.0f);
  EXPECT_TRUE(ReliefSky(relief, {}, 128).empty());
}

TEST(PlaceView, SeesTheReliefBeforeThePlanesBehindIt) {
  const Relief relief = findRelief(Room().surfaces(), kSun);
  const PlaceView view(PlaneView(floorPlane(), roomCamera()), relief);
  Receiver r;
  ASSERT_TRUE(view.at(20.0f, 70.0f, r));  // the floor goes on behind the wall
  EXPECT_NEAR(r.position.y(), kWallAway, 1e-3);
  ASSERT_TRUE(view.at(20.0f, 110.0f, r));
  EXPECT_NEAR(r.position.z(), 0.0f, 1e-3);
  std::uint8_t row[kWide];
  view.seesRow(0, 30, kWide, row);
  EXPECT_EQ(row[20], 255);  // above the horizon of the floor
  EXPECT_TRUE(relief.touches(0, 0, 16));
  EXPECT_FALSE(relief.touches(0, 112, 8));
}

}  // namespace
}  // namespace calipso::render
