#include "calipso_align/planar_pieces.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>
#include <random>

#include "calipso_align/relief.hpp"

namespace calipso::align {
namespace {

constexpr int kSize = 60;

// A relief of which only the surfaces matter here.
Relief reliefOf(const std::function<float(int, int)>& inverse_depth) {
  Relief relief;
  relief.surface.create(kSize, kSize, CV_32FC3);
  relief.state = cv::Mat(kSize, kSize, CV_8U, cv::Scalar(Relief::kSurface));
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      relief.surface.at<cv::Vec3f>(y, x) = cv::Vec3f(x, y, inverse_depth(x, y));
  return relief;
}

// A corner of two walls that leans, in front of a wall far away: a crease and a jump. With noise.
Relief corner() {
  std::mt19937 generator(1);
  std::normal_distribution<float> noise(0.0f, 0.5f);
  return reliefOf([&](int x, int y) {
    const float from_edge = x - 28 - 0.1f * y;
    return noise(generator) + (x > 50 ? 100.0f : 1000.0f - 12.0f * std::abs(from_edge));
  });
}

cv::Mat piecesOf(const Relief& relief) { return planarPieces(relief, creaseThreshold(relief)); }

TEST(PlanarPieces, CreasesAndJumpsPartThem) {
  const cv::Mat pieces = piecesOf(corner());
  const int left = pieces.at<int>(30, 10), right = pieces.at<int>(30, 42),
            behind = pieces.at<int>(30, 56);
  EXPECT_GT(left, 0);
  EXPECT_GT(right, 0);
  EXPECT_GT(behind, 0);
  EXPECT_NE(left, right);
  EXPECT_NE(right, behind);
  // The middle rows of the left wall, off the picture's border and the crease, are one piece but
  // for noise.
  const cv::Mat inner = pieces(cv::Rect(3, 5, 18, 50)) == left;
  EXPECT_GT(cv::countNonZero(inner), 0.95 * inner.total());
}

TEST(PlanarPieces, WhatIsCurvedIsNone) {
  const Relief relief = reliefOf([](int x, int y) {
    return 1000.0f - 0.3f * static_cast<float>((x - 30) * (x - 30) + (y - 30) * (y - 30));
  });
  EXPECT_EQ(cv::countNonZero(piecesOf(relief)), 0);
}

// Tiles between joints, one of which stands out of the wall.
TEST(SharedPlanes, TilesOfAWallShareOne) {
  std::mt19937 generator(1);
  std::normal_distribution<float> noise(0.0f, 0.5f);
  const Relief relief = reliefOf([&](int x, int y) {
    const float wall = 500.0f + 2.0f * x - y, joint = x % 20 == 19 ? 30.0f : 0.0f;
    return noise(generator) + wall - joint + (x > 40 ? 50.0f : 0.0f);
  });
  const cv::Mat pieces = piecesOf(relief);
  ASSERT_NE(pieces.at<int>(30, 10), pieces.at<int>(30, 30));
  const cv::Mat planes = sharedPlanes(relief, pieces);
  EXPECT_GT(planes.at<int>(30, 10), 0);
  EXPECT_EQ(planes.at<int>(30, 10), planes.at<int>(30, 30));
  EXPECT_GT(planes.at<int>(30, 50), 0);
  EXPECT_NE(planes.at<int>(30, 10), planes.at<int>(30, 50));
}

TEST(PlanarPieces, WithoutDepthThereAreNone) {
  Relief relief = corner();
  relief.state.setTo(Relief::kNone);
  EXPECT_EQ(cv::countNonZero(piecesOf(relief)), 0);
}

TEST(StrokesOfPieces, OnlyStrokesThatAgreeCount) {
  const cv::Mat pieces = piecesOf(corner());
  cv::Mat strokes = cv::Mat::zeros(kSize, kSize, CV_8U);
  strokes(cv::Rect(8, 20, 5, 5)).setTo(2);   // left wall
  strokes(cv::Rect(40, 20, 3, 3)).setTo(2);  // right wall, of two kinds
  strokes(cv::Rect(40, 30, 3, 3)).setTo(1);
  const cv::Mat of_pieces = strokesOfPieces(pieces, strokes);
  EXPECT_EQ(of_pieces.at<uchar>(45, 10), 2);
  EXPECT_EQ(of_pieces.at<uchar>(45, 42), 0);
  EXPECT_EQ(of_pieces.at<uchar>(45, 56), 0);
}

}  // namespace
}  // namespace calipso::align
