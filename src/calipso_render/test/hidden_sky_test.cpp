// What hidden pixels show of the sky, by what is seen above and below them.

#include "fill/hidden_sky.hpp"

#include <gtest/gtest.h>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

constexpr int kSky = InpaintParams::kSky, kNoSky = InpaintParams::kNoSky, kUnknown = 0;

// Sky over ground from row 60 on.
cv::Mat landscape() {
  cv::Mat sky(80, 100, CV_8U, cv::Scalar(kSky));
  sky.rowRange(60, 80).setTo(kNoSky);
  return sky;
}

TEST(HiddenSky, NothingElseIsBetweenSkyAndSky) {
  cv::Mat sky = landscape();
  sky(cv::Rect(10, 20, 5, 10)).setTo(kUnknown);
  sky(cv::Rect(30, 0, 5, 10)).setTo(kUnknown);   // up to the picture's border
  sky(cv::Rect(50, 20, 5, 45)).setTo(kUnknown);  // may be both
  const cv::Mat told = hiddenSky(sky);
  EXPECT_EQ(told.at<std::uint8_t>(25, 12), kSky);
  EXPECT_EQ(told.at<std::uint8_t>(5, 32), kSky);
  EXPECT_EQ(told.at<std::uint8_t>(40, 52), kUnknown);
}

// A gable is seen above what hides the rest of its house; a branch is held by a
// tree that is seen.
TEST(HiddenSky, WhatNothingSeenHoldsStandsOnWhatIsHidden) {
  cv::Mat sky = landscape();
  sky(cv::Rect(20, 40, 20, 10)).setTo(kNoSky);
  sky(cv::Rect(10, 50, 40, 12)).setTo(kUnknown);
  sky(cv::Rect(70, 10, 30, 4)).setTo(kNoSky);
  sky(cv::Rect(70, 14, 10, 50)).setTo(kUnknown);
  const cv::Mat told = hiddenSky(sky);
  EXPECT_EQ(told.at<std::uint8_t>(55, 30), kNoSky);
  EXPECT_EQ(told.at<std::uint8_t>(55, 15), kUnknown) << "beside it";
  EXPECT_EQ(told.at<std::uint8_t>(30, 75), kUnknown);
}

TEST(HiddenSky, ACopyTellsWhatItsOriginDoes) {
  cv::Mat sky = landscape(), origin(sky.size(), CV_16SC2, cv::Scalar(-1, -1));
  sky(cv::Rect(50, 20, 5, 45)).setTo(kUnknown);
  origin.at<cv::Vec2s>(40, 52) = {10, 70};
  EXPECT_EQ(copiedSky(sky, origin).at<std::uint8_t>(40, 52), kNoSky);
  EXPECT_EQ(copiedSky(sky, origin).at<std::uint8_t>(41, 52), kUnknown);
}

// A dark wall that is copied across the horizon by its looks alone would stand
// in the sky.
TEST(Inpaint, NothingButSkyIsCopiedToTheSky) {
  cv::Mat image(80, 100, CV_32FC3, cv::Scalar::all(90));
  cv::RNG(2).fill(image.rowRange(60, 80), cv::RNG::UNIFORM, cv::Scalar::all(70),
                  cv::Scalar::all(75));
  cv::Mat hole = cv::Mat::zeros(80, 100, CV_8U);
  hole(cv::Rect(30, 10, 40, 30)).setTo(255);
  InpaintParams params;
  params.coarsest_side = 20;
  params.sky = landscape();
  params.sky.setTo(kUnknown, hole);
  // What is known of the rim looks like ground.
  image(cv::Rect(26, 6, 48, 38)).setTo(cv::Scalar::all(72));
  const InpaintResult filled = inpaint(image, hole, cv::Mat(), params);
  for (int v = 10; v < 40; ++v) {
    for (int u = 30; u < 70; ++u)
      ASSERT_LT(filled.origin.at<cv::Vec2s>(v, u)[1], 60) << u << ", " << v;
  }
}

}  // namespace
}  // namespace calipso::render
