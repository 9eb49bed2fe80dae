#include "calipso_flow/picture_change.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace calipso::flow {
namespace {

const cv::Size kSize(80, 60);
const cv::Point kOrigin(20, 15);
const cv::Mat kWhere(30, 40, CV_8U, cv::Scalar(255));

// Waves of 20 px in both directions, or in u alone.
cv::Mat waves(double shift_u, double shift_v, bool across = true) {
  cv::Mat picture(kSize, CV_32F);
  const double k = 2.0 * CV_PI / 20.0;
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      const double wave = std::sin(k * (u - shift_u)) + (across ? std::sin(k * (v - shift_v)) : 0);
      picture.at<float>(v, u) = static_cast<float>(128.0 + 40.0 * wave);
    }
  }
  return picture;
}

double shiftTo(const cv::Mat& now) { return largestShift(waves(0, 0), now, kWhere, kOrigin); }

TEST(LargestShift, OfTheSamePictureIsNone) { EXPECT_EQ(shiftTo(waves(0, 0)), 0.0); }

TEST(LargestShift, BoundsEveryShiftClosely) {
  // Central differences of waves of 20 px are 2 % short, and the window holds no whole periods.
  EXPECT_NEAR(shiftTo(waves(0.5, 0)), 0.5, 0.1);
  EXPECT_NEAR(shiftTo(waves(0, 0.5)), 0.5, 0.1);
  EXPECT_NEAR(shiftTo(waves(0.3, -0.4)), 0.5, 0.1);
  for (const double far : {2.0, 5.0, 10.0}) EXPECT_GT(shiftTo(waves(far, 0)), 1.5) << far;
}

TEST(LargestShift, CountsNoiseAsMotion) {
  cv::Mat noise(kSize, CV_32F), now = waves(0, 0);
  cv::RNG(7).fill(noise, cv::RNG::NORMAL, 0.0, 4.0);
  now += noise;
  // The gradient's mean square is (40 k)^2 / 2 in each direction: 4 / 8.9 px.
  EXPECT_NEAR(shiftTo(now), 0.45, 0.05);
}

TEST(LargestShift, OfStripesAndFlatPicturesIsUnknown) {
  const cv::Mat stripes = waves(0, 0, false), flat(kSize, CV_32F, cv::Scalar(90));
  EXPECT_TRUE(std::isinf(largestShift(stripes, stripes, kWhere, kOrigin)));
  EXPECT_TRUE(std::isinf(largestShift(flat, flat, kWhere, kOrigin)));
}

TEST(LargestShift, LooksWhereItIsTold) {
  cv::Mat now = waves(0, 0);
  now.rowRange(0, kOrigin.y).setTo(0);
  EXPECT_EQ(shiftTo(now), 0.0);
  // What reaches beyond the picture is left out.
  EXPECT_EQ(largestShift(waves(0, 0), waves(0, 0), kWhere, {-5, 45}), 0.0);
}

}  // namespace
}  // namespace calipso::flow
