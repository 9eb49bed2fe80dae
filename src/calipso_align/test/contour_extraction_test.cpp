#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "calipso_align/contour.hpp"
#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using testing::box;
using testing::disc;
using testing::maskOf;
using testing::paint;

const cv::Size kSize(120, 100);
const cv::Vec3b kDark(60, 70, 50), kLight(190, 180, 200);

struct Deviation {
  double mean = 0.0, largest = 0.0;  // px, absolute
};

Deviation deviation(const ContourLoop& loop, const testing::SignedDistance& truth) {
  Deviation d;
  for (const Eigen::Vector2d& p : loop.points) {
    const double e = std::abs(truth(p.x(), p.y()));
    d.mean += e / loop.points.size();
    d.largest = std::max(d.largest, e);
  }
  return d;
}

cv::Mat labelsOf(const testing::SignedDistance& shape) { return maskOf(kSize, shape) / 255; }

TEST(Contour, TracesOnePixelAroundItsFourSides) {
  cv::Mat labels = cv::Mat::zeros(kSize, CV_8U);
  labels.at<uchar>(10, 20) = 3;
  ContourParams params;
  params.min_loop_points = 4;
  const auto loops = traceLoops(labels, 3, params);
  ASSERT_EQ(loops.size(), 1u);
  const std::vector<Eigen::Vector2d> expected = {{20, 9.5}, {20.5, 10}, {20, 10.5}, {19.5, 10}};
  EXPECT_EQ(loops[0].points, expected);
  EXPECT_FALSE(loops[0].hole);
}

TEST(Contour, JoinsDiagonalPixels) {
  cv::Mat labels = cv::Mat::zeros(kSize, CV_8U);
  for (int i = 0; i < 10; ++i) labels.at<uchar>(10 + i, 20 + i) = 1;
  EXPECT_EQ(traceLoops(labels, 1, {}).size(), 1u);
}

TEST(Contour, DiscIsFoundToATenthOfAPixel) {
  const auto shape = disc(60.37, 49.61, 30.42);
  const auto contour =
      extractContour(paint(kSize, shape, kDark, kLight, 2.0), labelsOf(shape), 1, "disc");
  ASSERT_EQ(contour.loops.size(), 1u);
  const Deviation d = deviation(contour.loops[0], shape);
  EXPECT_LT(d.mean, 0.1);
  EXPECT_LT(d.largest, 0.4);
}

TEST(Contour, RefinementBeatsTheMaskOnACleanEdge) {
  const auto shape = disc(60.37, 49.61, 30.42);
  const cv::Mat labels = labelsOf(shape);
  const auto refined = extractContour(paint(kSize, shape, kDark, kLight, 2.0), labels, 1, "disc");
  const auto raw = traceLoops(labels, 1, {});
  EXPECT_LT(deviation(refined.loops[0], shape).mean, 0.5 * deviation(raw[0], shape).mean);
}

TEST(Contour, WithoutContrastTheMaskCounts) {
  const auto shape = disc(60.37, 49.61, 30.42);
  const auto contour =
      extractContour(cv::Mat(kSize, CV_8UC3, cv::Scalar(90, 90, 90)), labelsOf(shape), 1, "disc");
  // The mask knows the edge to a quarter of a pixel on average (uniform within +-1/2 px).
  EXPECT_LT(deviation(contour.loops[0], shape).mean, 0.25);
  for (const float confidence : contour.loops[0].confidence) EXPECT_LE(confidence, 0.3f);
}

// The rim's inner side is the only place where colours change from about the disc's to the
// surroundings'.
TEST(Contour, ARimOfAThirdColourLeavesTheMask) {
  const auto shape = disc(60.37, 49.61, 30.42), inside = disc(60.37, 49.61, 29.2);
  const cv::Vec3b grey(125, 125, 125), darker(100, 100, 100);
  const cv::Mat rim = paint(kSize, shape, {235, 235, 235}, grey);
  const auto contour =
      extractContour(paint(kSize, inside, darker, grey, 2.0, rim), labelsOf(shape), 1, "mug");
  // What the mask alone tells.
  EXPECT_LT(deviation(contour.loops[0], shape).mean, 0.25);
}

TEST(Contour, CornersDoNotShrink) {
  const auto shape = box(30.3, 25.2, 85.6, 74.7);
  const auto contour =
      extractContour(paint(kSize, shape, kDark, kLight, 2.0), labelsOf(shape), 1, "box");
  const std::vector<Eigen::Vector2d> corners = {
      {30.3, 25.2}, {85.6, 25.2}, {85.6, 74.7}, {30.3, 74.7}};
  for (const Eigen::Vector2d& corner : corners) {
    double nearest = 1e9;
    for (const auto& p : contour.loops[0].points) nearest = std::min(nearest, (p - corner).norm());
    // Points lie on pixel sides, so the last one before a corner is up to 0.7 px short of it.
    EXPECT_LT(nearest, 0.8);
  }
  EXPECT_LT(deviation(contour.loops[0], shape).mean, 0.12);
}

TEST(Contour, HolesAreInnerLoops) {
  const auto ring = [](double u, double v) {
    const double r = std::hypot(u - 60.2, v - 50.1);
    return std::max(r - 40.3, 20.4 - r);
  };
  const auto contour =
      extractContour(paint(kSize, ring, kDark, kLight, 2.0), labelsOf(ring), 1, "ring");
  ASSERT_EQ(contour.loops.size(), 2u);
  EXPECT_FALSE(contour.loops[0].hole);
  EXPECT_TRUE(contour.loops[1].hole);
  EXPECT_LT(deviation(contour.loops[1], ring).mean, 0.1);
}

TEST(Contour, UnknownAtTheImageBorder) {
  const auto shape = disc(5, 50, 25);
  const auto contour =
      extractContour(paint(kSize, shape, kDark, kLight), labelsOf(shape), 1, "cut");
  const ContourLoop& loop = contour.loops[0];
  for (size_t i = 0; i < loop.points.size(); ++i)
    EXPECT_EQ(loop.known[i], loop.points[i].x() > 0.5) << loop.points[i].transpose();
}

TEST(Contour, UnknownWhereAnotherObjectTouches) {
  const auto left = box(20.5, 20.5, 60.5, 80.5), right = box(60.5, 20.5, 100.5, 80.5);
  cv::Mat labels = labelsOf(left) + 2 * labelsOf(right);
  const auto contour =
      extractContour(cv::Mat(kSize, CV_8UC3, cv::Scalar(90, 90, 90)), labels, 1, "left");
  const ContourLoop& loop = contour.loops[0];
  for (size_t i = 0; i < loop.points.size(); ++i) {
    const double u = loop.points[i].x();
    if (u < 57.0 || u > 60.4) {
      EXPECT_EQ(loop.known[i], u < 57.0) << loop.points[i].transpose();
    }
    EXPECT_EQ(loop.known[i], loop.confidence[i] > 0.0f);
  }
}

TEST(Contour, AMissingObjectIsNamed) {
  try {
    extractContour(cv::Mat(kSize, CV_8UC3), cv::Mat::zeros(kSize, CV_8U), 4, "kite");
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("object 'kite' (label 4)"), std::string::npos);
  }
}

}  // namespace
}  // namespace calipso::align
