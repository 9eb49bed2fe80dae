#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "fill/lattice.hpp"
#include "fill/plane_chart.hpp"
#include "fill/spline.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 320, kHigh = 200;

// Tiles of 1 by 0.8 with dark joints, with a grain that does not repeat.
float tileAt(double x, double y) {
  const double u = x - std::floor(x), v = (y / 0.8 - std::floor(y / 0.8)) * 0.8;
  return std::min(std::min(u, 1.0 - u), std::min(v, 0.8 - v)) < 0.06 ? 60.0f : 180.0f;
}

// A picture of them, every pixel the mean of nine places.
cv::Mat tiles(const cv::Matx33d& to_plane) {
  cv::Mat image(kHigh, kWide, CV_32FC3);
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      float sum = 0.0f;
      for (int i = 0; i < 9; ++i) {
        const cv::Point2d p = taken(to_plane, u + (i % 3 - 1) / 3.0, v + (i / 3 - 1) / 3.0);
        sum += tileAt(p.x, p.y) / 9.0f;
      }
      image.at<cv::Vec3f>(v, u) = cv::Vec3f::all(sum);
    }
  }
  cv::Mat grain(image.size(), CV_32FC3);
  cv::RNG random(7);
  random.fill(grain, cv::RNG::NORMAL, 0.0, 2.0);
  return image + grain;
}

// Turned by 0.3 rad, 30 px to a tile, upright or twice as near at the lower border as at the upper
// one.
cv::Matx33d seenFrom(bool tilted) {
  const double c = std::cos(0.3) / 30.0, s = std::sin(0.3) / 30.0;
  return cv::Matx33d(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0) *
         cv::Matx33d(1.0, 0.0, -160.0, 0.0, 1.0, -100.0, 0.0, tilted ? 1.0 / 300.0 : 0.0,
                     tilted ? 2.0 / 3.0 : 1.0);
}

TEST(FindLattice, TellsTheShiftsOfTiles) {
  const auto lattice =
      findLattice(tiles(seenFrom(false)), cv::Mat(kHigh, kWide, CV_8U, cv::Scalar(255)));
  ASSERT_TRUE(lattice);
  EXPECT_NEAR(std::abs(cv::determinant(lattice->basis)), 30.0 * 24.0, 8.0);  // one tile, no more
  for (const cv::Point2f& shift : {cv::Point2f(30 * std::cos(0.3), 30 * std::sin(0.3)),
                                   cv::Point2f(-24 * std::sin(0.3), 24 * std::cos(0.3))})
    EXPECT_LT(cv::norm(lattice->nearest(shift) - shift),
              0.3);  // px: peaks are told to a part of a pixel
}

// As a camera of four times as many pixels sees them.
TEST(FindLattice, TellsTheShiftsOfLargeTilesInHalfTheSize) {
  cv::Mat large;
  cv::resize(tiles(seenFrom(false)), large, {}, 4.0, 4.0, cv::INTER_CUBIC);
  const cv::Mat known(large.size(), CV_8U, cv::Scalar(255));
  EXPECT_FALSE(findLattice(large, known));
  const auto lattice = findLattice(large, known, 2);
  ASSERT_TRUE(lattice);
  for (const cv::Point2f& shift : {cv::Point2f(120 * std::cos(0.3), 120 * std::sin(0.3)),
                                   cv::Point2f(-96 * std::sin(0.3), 96 * std::cos(0.3))})
    EXPECT_LT(cv::norm(lattice->nearest(shift) - shift), 1.0);  // px
}

TEST(FindLattice, FindsNoneInGrainAndInLines) {
  cv::Mat grain(kHigh, kWide, CV_32FC3), lines(kHigh, kWide, CV_32FC3);
  cv::RNG random(3);
  random.fill(grain, cv::RNG::UNIFORM, 0.0, 255.0);
  cv::GaussianBlur(grain, grain, {0, 0}, 3.0);
  for (int u = 0; u < kWide; ++u) lines.col(u).setTo(cv::Scalar::all(u % 20 < 4 ? 60 : 180));
  const cv::Mat known(kHigh, kWide, CV_8U, cv::Scalar(255));
  EXPECT_FALSE(findLattice(grain, known));
  EXPECT_FALSE(findLattice(lines, known));
}

// Tiles go on behind all of a hole with a spot beside it, not where half of the picture is no tiles.
TEST(GoesOnByPattern, SmallSpotsDoNotEndAPattern) {
  const cv::Mat image = tiles(seenFrom(false));
  cv::Mat hole = cv::Mat::zeros(kHigh, kWide, CV_8U);
  hole(cv::Rect(130, 60, 60, 80)).setTo(255);
  const auto lattice = findLattice(image, hole == 0);
  ASSERT_TRUE(lattice);
  const auto goneOn = [&](const cv::Rect& otherwise) {
    cv::Mat look = image.clone();
    look(otherwise).setTo(cv::Scalar::all(20));
    look.setTo(0, hole);
    const cv::Mat known = hole == 0;
    return cv::countNonZero(goesOnByPattern(repeatsBy(*lattice, look, known, known), known, hole));
  };
  EXPECT_EQ(goneOn({120, 95, 2, 2}), 60 * 80);
  EXPECT_LT(goneOn({200, 0, 120, kHigh}), 0.8 * 60 * 80);
}

TEST(Spline, GoesThroughThePixelsAndKeepsWaves) {
  cv::Mat wave(60, 60, CV_32FC3);
  const auto at = [](double u, double v) {
    return static_cast<float>(100.0 + 50.0 * std::sin(0.9 * u + 0.4 * v));
  };
  for (int v = 0; v < 60; ++v) {
    for (int u = 0; u < 60; ++u) wave.at<cv::Vec3f>(v, u) = cv::Vec3f::all(at(u, v));
  }
  const cv::Mat spline = splineOf(wave);
  for (int k = 0; k < 50; ++k) {
    const int u = 10 + (7 * k) % 40, v = 10 + (11 * k) % 40;
    EXPECT_NEAR(sampleSpline(spline, u, v)[1], at(u, v), 1e-2);
    // A wave of seven pixels; Catmull-Rom's error is 1.6 here.
    EXPECT_NEAR(sampleSpline(spline, u + 0.5, v + 0.5)[1], at(u + 0.5, v + 0.5), 0.3);
  }
  EXPECT_NEAR(sampleSpline(spline, 0, 0)[0], at(0, 0), 1e-2);
  EXPECT_NEAR(sampleSpline(spline, 59, 59)[0], at(59, 59), 1e-2);
}

TEST(PlaneChart, LeavesTheMiddleOfTheHoleAsItIs) {
  const cv::Matx33d to_plane = seenFrom(true);
  cv::Mat hole = cv::Mat::zeros(kHigh, kWide, CV_8U);
  hole(cv::Rect(120, 60, 81, 81)).setTo(255);
  const auto chart = planeChart(to_plane, hole, hole == 0);
  ASSERT_TRUE(chart);
  EXPECT_TRUE(chart->tilted);
  const cv::Point2d middle = taken(chart->to_chart, 160, 100);
  EXPECT_NEAR((taken(chart->to_chart, 161, 100) - middle).x, 1.0, 0.02);
  EXPECT_NEAR((taken(chart->to_chart, 160, 101) - middle).y, 1.0, 0.02);
  // A shift of the plane is the same shift of the chart everywhere.
  const auto shifted = [&](double u, double v) {
    const cv::Point2d x = taken(to_plane, u, v);
    return taken(chart->to_chart * to_plane.inv(), x.x + 1.0, x.y) - taken(chart->to_chart, u, v);
  };
  EXPECT_LT(cv::norm(shifted(40, 30) - shifted(250, 170)), 1e-6);
  EXPECT_FALSE(planeChart(seenFrom(false), hole, hole == 0)->tilted);
}

// What is known of the tiles' plane: nothing, all, its lower half, or that it is a support plane.
enum class Plane { kUnknown, kKnown, kHalf, kSupposed };

// Mean difference from the true tiles of what a hole is filled with.
double missOfTiles(bool tilted, Plane plane) {
  const cv::Matx33d to_plane = seenFrom(tilted);
  const cv::Mat truth = tiles(to_plane);
  cv::Mat image = truth.clone(), hole = cv::Mat::zeros(kHigh, kWide, CV_8U);
  cv::ellipse(hole, {160, 100}, {60, 45}, 0, 0, 360, cv::Scalar(255), cv::FILLED);
  image.setTo(cv::Scalar::all(0), hole);
  InpaintParams params;
  if (plane != Plane::kUnknown) params.planes = {to_plane}, params.supports = 1;
  if (plane == Plane::kKnown || plane == Plane::kHalf) {
    params.surface = cv::Mat(hole.size(), CV_8U, cv::Scalar(1)),
    params.sure = cv::Mat(hole.size(), CV_8U, cv::Scalar(255));
    if (plane == Plane::kHalf)
      params.surface.rowRange(0, kHigh / 2).setTo(0), params.sure.rowRange(0, kHigh / 2).setTo(0);
  }
  const InpaintResult r = inpaint(image, hole, cv::Mat(), params);
  EXPECT_TRUE(r.patches_found);
  EXPECT_EQ(cv::norm(r.image, image, cv::NORM_INF, hole == 0), 0.0);
  cv::Mat difference;
  cv::absdiff(r.image, truth, difference);
  return cv::mean(difference, hole)[0];
}

// The grain alone differs by 2.3 (two of deviation 2); joints, 15 % of the place, by 120 code
// values, along whose rims a tenth of a pixel is 12.
TEST(Inpaint, GoesOnWithTilesAsTheyAreSeen) {
  EXPECT_LT(missOfTiles(true, Plane::kKnown), 6.0);
  EXPECT_LT(missOfTiles(false, Plane::kKnown), 5.0);
  EXPECT_GT(missOfTiles(true, Plane::kUnknown), 9.0);
}

TEST(Inpaint, FollowsTilesToWhereNothingElseTellsTheirPlane) {
  EXPECT_LT(missOfTiles(true, Plane::kHalf), 6.0);
  EXPECT_LT(missOfTiles(true, Plane::kSupposed), 6.0);
}

// Nothing of what was in the hole shines through along its rim, dark as it was.
TEST(Inpaint, LeavesNoRimAroundWhatItFillsAlongAPlane) {
  const cv::Matx33d to_plane = seenFrom(true);
  cv::Mat image(kHigh, kWide, CV_32FC3), hole = cv::Mat::zeros(kHigh, kWide, CV_8U), inner;
  cv::RNG random(3);
  random.fill(image, cv::RNG::NORMAL, cv::Scalar::all(150.0), cv::Scalar::all(4.0));
  cv::GaussianBlur(image, image, {0, 0}, 1.0);
  cv::ellipse(hole, {160, 100}, {60, 45}, 0, 0, 360, cv::Scalar(255), cv::FILLED);
  image.setTo(cv::Scalar::all(0), hole);
  InpaintParams params;
  params.surface = cv::Mat(hole.size(), CV_8U, cv::Scalar(1)),
  params.sure = cv::Mat(hole.size(), CV_8U, cv::Scalar(255));
  params.planes = {to_plane}, params.supports = 1;
  const cv::Mat filled = inpaint(image, hole, cv::Mat(), params).image;
  cv::erode(hole, inner, cv::Mat::ones(3, 3, CV_8U));
  // 330 pixels of deviation 1.1, hardly correlated: 0.1
  EXPECT_NEAR(cv::mean(filled, hole & ~inner)[0], 150.0, 0.5);
}

}  // namespace
}  // namespace calipso::render
