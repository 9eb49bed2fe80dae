// How a surface's colour changes slowly over the picture.

#include "fill/colour_trend.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace calipso::render {
namespace {

constexpr int kWide = 160, kHigh = 100;

// Water: brighter with its distance, with waves; a boat in a tenth of it.
cv::Mat water(float contrast) {
  cv::Mat image(kHigh, kWide, CV_32FC3);
  cv::RNG random(3);
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      const float far = 1.0f - static_cast<float>(v) / kHigh;
      const float wave = static_cast<float>(random.gaussian(6.0));
      image.at<cv::Vec3f>(v, u) = cv::Vec3f(110, 100, 90) +
                                  contrast * far * far * cv::Vec3f(90, 80, 70) +
                                  cv::Vec3f::all(wave);
    }
  }
  image(cv::Rect(60, 40, 40, 40)).setTo(cv::Scalar(20, 20, 160));
  return image;
}

TEST(ColourTrend, GoesOnWhereNothingIsKnown) {
  const cv::Mat image = water(1.0f);
  cv::Mat known(kHigh, kWide, CV_8U, cv::Scalar(255));
  known(cv::Rect(0, 30, kWide, 35)).setTo(0);
  const cv::Mat trend = colourTrend(image, known);
  const auto rise = [&](int v) { return std::pow(1.0f - static_cast<float>(v) / kHigh, 2); };
  for (const int v : {10, 30, 50, 70, 90}) {
    const float wanted = 80.0f * static_cast<float>(rise(v) - rise(10)),
                got = trend.at<cv::Vec3f>(v, 20)[1] - trend.at<cv::Vec3f>(10, 20)[1];
    EXPECT_NEAR(got, wanted, 6.0f) << v;
  }
}

TEST(ColourTrend, IsNothingWhereItSaysLittle) {
  const cv::Mat known(kHigh, kWide, CV_8U, cv::Scalar(255));
  EXPECT_EQ(cv::norm(colourTrend(water(0.1f), known), cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(colourTrend(water(1.0f), cv::Mat::zeros(kHigh, kWide, CV_8U)), cv::NORM_INF),
            0.0);
}

}  // namespace
}  // namespace calipso::render
