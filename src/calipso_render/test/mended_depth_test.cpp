// Depth images with the gaps that measured ones have.

#include "place/mended_depth.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/background.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 320, kHigh = 200;

// Looks down on a table by 25 degrees, from 0.5 m above it; its horizon is in the picture.
Camera overTable() {
  Camera c;
  c.width = kWide, c.height = kHigh, c.fx = c.fy = 200.0, c.cx = 159.5, c.cy = 99.5;
  const double angle = 25.0 * M_PI / 180.0;
  Eigen::Matrix3d turn;  // columns: right, down, forward
  turn.col(0) = Eigen::Vector3d::UnitX();
  turn.col(2) = Eigen::Vector3d(0.0, std::cos(angle), -std::sin(angle));
  turn.col(1) = turn.col(2).cross(turn.col(0));
  c.world_from_camera.linear() = turn;
  c.world_from_camera.translation() = Eigen::Vector3d(0.0, 0.0, 0.5);
  return c;
}

struct Table {
  Camera camera = overTable();
  std::vector<SupportPlane> planes{SupportPlane()};
  cv::Mat truth, labels = cv::Mat::zeros(kHigh, kWide, CV_8U);

  Table() {
    const cv::Mat ground = groundNearness(planes, camera, cv::Mat());
    truth = cv::Mat::zeros(ground.size(), CV_32F);
    cv::Mat(1.0 / ground).copyTo(truth, ground > 0.0f);
  }
  cv::Mat mended(const cv::Mat& depth) const { return mendedDepth(depth, labels, planes, camera); }
};

double missAt(const cv::Mat& depth, const cv::Mat& truth, const cv::Rect& where) {
  return cv::norm(depth(where), truth(where), cv::NORM_INF);
}

TEST(MendedDepth, NarrowGapsGetThePlanesDepth) {
  const Table table;
  const cv::Rect square(100, 120, 14, 12), mirrored(200, 150, 12, 12);
  cv::Mat depth = table.truth.clone();
  depth(square).setTo(0.0f), depth(mirrored).setTo(3.0f);
  const cv::Mat mended = table.mended(depth);
  EXPECT_LT(missAt(mended, table.truth, {0, 40, kWide, kHigh - 40}), 1e-5);
  EXPECT_EQ(cv::norm(mended, depth, cv::NORM_INF, table.truth == 0.0f), 0.0);
}

TEST(MendedDepth, GapsBesideAnObjectAreNarrowToo) {
  Table table;
  const cv::Rect object(140, 60, 30, 80), beside(170, 100, 12, 30);
  table.labels(object).setTo(1);
  cv::Mat depth = table.truth.clone();
  depth(object).setTo(0.4f), depth(beside).setTo(0.0f);
  const cv::Mat mended = table.mended(depth);
  EXPECT_LT(missAt(mended, table.truth, beside), 1e-5);
  EXPECT_EQ(missAt(mended, depth, object), 0.0);
}

// Between the rungs of a ladder that stands at a quay's edge water is seen, far below.
TEST(MendedDepth, WhatIsSeenBetweenTheMembersOfALatticeStays) {
  Table table;
  cv::Mat depth = table.truth.clone();
  const int edge = 110;
  for (int v = 0; v < edge; ++v) depth.row(v) *= 1.5f;
  for (int v = 60; v < edge + 12; v += 12) {
    table.labels(cv::Rect(140, v, 40, 3)).setTo(1);
    for (const int u : {140, 157, 177}) table.labels(cv::Rect(u, v, 3, 12)).setTo(1);
  }
  depth.setTo(0.4f, table.labels != 0);
  EXPECT_EQ(cv::norm(table.mended(depth), depth, cv::NORM_INF), 0.0);
}

TEST(MendedDepth, ThingsAndWideGapsStay) {
  const Table table;
  const cv::Rect thing(100, 120, 14, 12), wide(180, 90, 90, 80);
  cv::Mat depth = table.truth.clone();
  depth(thing) *= 0.8f, depth(wide).setTo(0.0f);
  const cv::Mat mended = table.mended(depth);
  EXPECT_EQ(missAt(mended, depth, thing), 0.0);
  EXPECT_EQ(missAt(mended, depth, {wide.x + 10, wide.y + 10, wide.width - 20, wide.height - 20}),
            0.0);
}

// A wall some way behind the table's far edge, seen down below the table: where the table would go
// on is neither a gap nor, where the wall is as near as that, the table.
TEST(MendedDepth, AWallSeenBeyondATablesEdgeStays) {
  const Table table;
  cv::Mat depth = table.truth.clone();
  const float edge = 0.9f, wall = 1.05f;  // m
  const Eigen::Isometry3d& camera = table.camera.world_from_camera;
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      const Eigen::Vector3d ray = camera.linear() * table.camera.ray(u, v);
      float& d = depth.at<float>(v, u);
      if (d == 0.0f || (camera * Eigen::Vector3d(table.camera.ray(u, v) * d)).y() > edge)
        d = static_cast<float>(wall / ray.y());
    }
  }
  EXPECT_EQ(cv::norm(table.mended(depth), depth, cv::NORM_INF), 0.0);
  // What has no depth says nothing about what is beside it.
  for (int v = 3; v < kHigh; v += 7) {
    for (int u = 0; u < kWide; u += 6) depth.at<float>(v, u) = 0.0f;
  }
  EXPECT_EQ(cv::countNonZero((table.mended(depth) != depth) & (depth > 0.0f)), 0);
}

// Beside an object that stands at a board's far edge the table beyond is no gap of the board.
TEST(MendedDepth, ATableSeenBeyondABoardsEdgeStays) {
  Table table;
  SupportPlane board;
  board.offset = 0.1;
  table.planes.push_back(board);
  const cv::Mat on_board = 1.0 / groundNearness({board}, table.camera, cv::Mat());
  cv::Mat depth = table.truth.clone();
  const cv::Rect top(0, 80, kWide, kHigh - 80), object(140, 50, 30, 60);
  on_board(top).copyTo(depth(top));
  table.labels(object).setTo(1), depth(object).setTo(0.4f);
  EXPECT_EQ(cv::norm(table.mended(depth), depth, cv::NORM_INF), 0.0);
}

TEST(MendedDepth, WithoutPlanesOrDepthImageNothingChanges) {
  Table table;
  EXPECT_TRUE(table.mended(cv::Mat()).empty());
  cv::Mat depth = table.truth.clone();
  depth(cv::Rect(100, 120, 14, 12)).setTo(0.0f);
  table.planes.clear();
  EXPECT_EQ(cv::norm(table.mended(depth), depth, cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace calipso::render
