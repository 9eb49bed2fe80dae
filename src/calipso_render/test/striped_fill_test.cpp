#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "fill/plane_chart.hpp"
#include "fill/row_periods.hpp"
#include "fill/stripes.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 480, kHigh = 300;
constexpr double kStripe = 0.8;                                        // units of the plane
constexpr std::array<double, 5> kPeriods = {1.1, 1.6, 0.7, 2.1, 1.4};  // of the marks in a stripe

// A weave: stripes along x, each of its own colour, with marks at its own distance.
cv::Vec3f weaveAt(double x, double y) {
  const double row = std::floor(y / kStripe), across = y / kStripe - row;
  const int k = (static_cast<int>(row) % 5 + 5) % 5;
  const double along = x / kPeriods[k] - std::floor(x / kPeriods[k]);
  const bool marked = std::abs(along - 0.5) < 0.2 && std::abs(across - 0.5) < 0.3;
  const float base = 60.0f + 35.0f * static_cast<float>(k);
  return marked ? cv::Vec3f(200.0f, 210.0f, 120.0f) : cv::Vec3f(base, 200.0f - base, 90.0f);
}

// A picture of it, every pixel the mean of nine places.
cv::Mat weave(const cv::Matx33d& to_plane) {
  cv::Mat image(kHigh, kWide, CV_32FC3), grain(kHigh, kWide, CV_32FC3);
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      cv::Vec3f sum;
      for (int i = 0; i < 9; ++i) {
        const cv::Point2d p = taken(to_plane, u + (i % 3 - 1) / 3.0, v + (i / 3 - 1) / 3.0);
        sum += weaveAt(p.x, p.y) / 9.0f;
      }
      image.at<cv::Vec3f>(v, u) = sum;
    }
  }
  cv::RNG random(5);
  random.fill(grain, cv::RNG::NORMAL, 0.0, 2.0);
  return image + grain;
}

// 40 px to a unit in the middle; tilted: twice as near at the lower border as at the upper one.
cv::Matx33d seenFrom(double turned, bool tilted) {
  const double c = std::cos(turned) / 40.0, s = std::sin(turned) / 40.0;
  return cv::Matx33d(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0) *
         cv::Matx33d(1.0, 0.0, -240.0, 0.0, 1.0, -150.0, 0.0, tilted ? 1.0 / 450.0 : 0.0,
                     tilted ? 2.0 / 3.0 : 1.0);
}

cv::Mat ellipse() {
  cv::Mat hole = cv::Mat::zeros(kHigh, kWide, CV_8U);
  cv::ellipse(hole, {240, 150}, {80, 75}, 0, 0, 360, cv::Scalar(255), cv::FILLED);
  return hole;
}

TEST(StripesAcross, TellsTheirDirection) {
  const cv::Mat hole = ellipse();
  for (const double turned : {-1.2, -0.3, 0.0, 0.2}) {
    const auto direction = stripesAcross(weave(seenFrom(turned, false)), hole, hole == 0);
    ASSERT_TRUE(direction) << turned;
    EXPECT_NEAR(*direction, turned, 0.01);
  }
}

TEST(StripesAcross, FindsNoneInGrainInSpotsAndUnderLight) {
  const cv::Mat hole = ellipse();
  cv::Mat grain(kHigh, kWide, CV_32FC3), spots, light(kHigh, kWide, CV_32FC3);
  cv::RNG random(7);
  random.fill(grain, cv::RNG::NORMAL, 120.0, 20.0);
  cv::GaussianBlur(grain, spots, {0, 0}, 6.0);
  for (int v = 0; v < kHigh; ++v) light.row(v).setTo(cv::Scalar::all(80.0 + 0.3 * v));
  EXPECT_FALSE(stripesAcross(grain, hole, hole == 0));
  EXPECT_FALSE(stripesAcross(20.0 * spots, hole, hole == 0));
  EXPECT_FALSE(stripesAcross(light + 0.2 * grain, hole, hole == 0));
  EXPECT_FALSE(stripesAcross(light, hole, cv::Mat::zeros(hole.size(), CV_8U)));  // nothing is known
}

TEST(RowPeriods, TellsThatOfEachStripe) {
  const std::vector<float> periods =
      rowPeriods(weave(seenFrom(0.0, false)), cv::Mat(kHigh, kWide, CV_8U, cv::Scalar(255)));
  for (int row = -4; row <= 3; ++row) {
    const int v = 150 + cvRound(40.0 * kStripe * (row + 0.5)), k = ((row % 5) + 5) % 5;
    EXPECT_NEAR(periods[v], 40.0 * kPeriods[k], 0.3) << row;
  }
}

// Mean difference from the true weave of what a hole is filled with.
double missOfWeave(bool known_plane) {
  const cv::Matx33d to_plane = seenFrom(0.2, true);
  const cv::Mat truth = weave(to_plane), hole = ellipse();
  cv::Mat image = truth.clone(), difference;
  image.setTo(cv::Scalar::all(0), hole);
  InpaintParams params;
  params.planes = {to_plane}, params.supports = 1;
  params.surface = cv::Mat(hole.size(), CV_8U, cv::Scalar(known_plane ? 1 : 0)),
  params.sure = cv::Mat(hole.size(), CV_8U, cv::Scalar(known_plane ? 255 : 0));
  const InpaintResult r = inpaint(image, hole, cv::Mat(), params);
  EXPECT_EQ(cv::norm(r.image, image, cv::NORM_INF, hole == 0), 0.0);
  cv::absdiff(r.image, truth, difference);
  const cv::Scalar mean = cv::mean(difference, hole);
  return (mean[0] + mean[1] + mean[2]) / 3.0;
}

// The grain alone differs by 2.3; marks, a third of a stripe, are 80 code values off where they
// should not be.
TEST(Inpaint, GoesOnWithEveryStripeAsItRepeatsItself) {
  EXPECT_LT(missOfWeave(true), 8.0);
  EXPECT_GT(missOfWeave(false), 16.0);
}

}  // namespace
}  // namespace calipso::render
