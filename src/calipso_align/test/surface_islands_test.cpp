#include "calipso_align/surface_islands.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_align/planar_pieces.hpp"
#include "calipso_align/relief.hpp"
#include "calipso_align/segmentation.hpp"
#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using namespace testing;

const cv::Size kSize(160, 120);
const cv::Vec3b kGreen(40, 160, 60), kGrey(150, 150, 150);
const SignedDistance kBowl = disc(80.3, 60.7, 30.2);

// A bowl, 0.8 m away, before a wall at 2 m on whose left a step of 0.5 m stands.
cv::Mat depthOfBowl() {
  cv::Mat depth(kSize, CV_32F, cv::Scalar(2.0));
  depth(cv::Rect(0, 0, 20, kSize.height)).setTo(1.5f);
  for (int v = 0; v < kSize.height; ++v)
    for (int u = 0; u < kSize.width; ++u) {
      const double r = 1.0 + kBowl(u, v) / 30.2;  // 0 in the middle, 1 at the outline
      if (r < 1.0) depth.at<float>(v, u) = static_cast<float>(1.0 - 0.2 * (1.0 - r * r));
    }
  return depth;
}

Relief reliefOfBowl() {
  cv::Mat image = paint(kSize, kBowl, kGreen, kGrey, 2.0);
  image(cv::Rect(0, 0, 20, kSize.height)).setTo(cv::Scalar(20, 20, 20));
  return makeRelief(image, depthOfBowl());
}

TEST(SurfaceIslands, JumpsPartThem) {
  const Relief relief = reliefOfBowl();
  ASSERT_TRUE(relief.registered);
  const cv::Mat& islands = relief.islands;
  const int bowl = islands.at<int>(60, 80), wall = islands.at<int>(10, 80),
            step = islands.at<int>(60, 5);
  EXPECT_NE(bowl, wall);
  EXPECT_NE(bowl, step);
  EXPECT_NE(wall, step);
  EXPECT_EQ(wall, islands.at<int>(110, 150));
  EXPECT_GT(intersectionOverUnion(islands == bowl, maskOf(kSize, kBowl)), 0.9);
  EXPECT_EQ(cv::countNonZero((islands == bowl) & (maskOf(kSize, kBowl) == 0)), 0);
}

TEST(SurfaceIslands, WhereThereIsNoSurfaceThereIsNone) {
  Relief relief = reliefOfBowl();
  relief.state(cv::Rect(20, 0, 140, 20)).setTo(Relief::kNone);
  const cv::Mat islands = surfaceIslands(relief, creaseThreshold(relief));
  EXPECT_EQ(cv::countNonZero(islands(cv::Rect(20, 0, 140, 20))), 0);
}

TEST(SeedsOfIslands, OnlyAnObjectsOwnIslandCounts) {
  const cv::Mat islands = (cv::Mat_<int>(1, 8) << 1, 1, 2, 2, 3, 3, 4, 0);
  const cv::Mat seeds = (cv::Mat_<uchar>(1, 8) << 2, 0, 3, 2, 1, 0, 0, 2);
  const cv::Mat everywhere(1, 8, CV_8U, cv::Scalar(255));
  const cv::Mat expected = (cv::Mat_<uchar>(1, 8) << 2, 2, 0, 0, 0, 0, 0, 0);
  EXPECT_EQ(cv::countNonZero(seedsOfIslands(islands, seeds, {everywhere, everywhere}) != expected),
            0);
  cv::Mat part = everywhere.clone();
  part.at<uchar>(0, 1) = 0;  // island 1 goes on where its object may not lie
  EXPECT_EQ(cv::countNonZero(seedsOfIslands(islands, seeds, {part, everywhere})), 0);
}

// The bowl's right half looks like the wall, and a piece of the wall beside it like the bowl.
TEST(Segmenter, AnIslandIsOneObjectWhateverItsColours) {
  const auto left = [](double u, double v) { return std::max(kBowl(u, v), u - 80.0); };
  cv::Mat image = paint(kSize, left, kGreen, kGrey, 3.0);
  image(cv::Rect(0, 0, 20, kSize.height)).setTo(cv::Scalar(20, 20, 20));
  image(cv::Rect(46, 40, 10, 40)).setTo(kGreen);
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  strokes(cv::Rect(60, 55, 15, 8)).setTo(1);
  const std::vector<SegmentationTarget> targets = {{"bowl", 1, cv::Rect(42, 22, 78, 78), {}, {}}};
  Segmenter segmenter(image, targets, {}, depthOfBowl());
  EXPECT_GE(intersectionOverUnion(segmenter.segment(strokes) == 1, maskOf(kSize, kBowl)), 0.98);
}

// Its inside bears the stroke, its outside is nearer by a jump and looks like the table.
TEST(Segmenter, WhatStandsOnASupportIsOneObjectInsideAndOutside) {
  const auto inside = [](double u, double v) { return std::max(kBowl(u, v), v - 60.0); };
  cv::Mat image = paint(kSize, inside, kGreen, kGrey, 3.0);
  const cv::Mat table(kSize, CV_32F, cv::Scalar(2.0));
  cv::Mat depth = table.clone();
  depth.setTo(1.5, maskOf(kSize, kBowl));
  depth.setTo(1.7, maskOf(kSize, inside));
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  strokes(cv::Rect(70, 42, 20, 6)).setTo(1);
  const std::vector<SegmentationTarget> targets = {{"bowl", 1, cv::Rect(46, 26, 70, 70), {}, {}}};
  Segmenter segmenter(image, targets, {}, depth, {table});
  EXPECT_GE(intersectionOverUnion(segmenter.segment(strokes) == 1, maskOf(kSize, kBowl)), 0.98);
}

}  // namespace
}  // namespace calipso::align
