#include "light/shadow_check.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace calipso::render {
namespace {

// Grey ground with grain of twelve code values, and two predicted shadows; nothing hides the sky.
struct Ground {
  cv::Mat picture{120, 200, CV_32FC3, cv::Scalar::all(150)},
      sun{120, 200, CV_32F, cv::Scalar(1.0f)}, sky = sun.clone();
  cv::Mat unknown = cv::Mat::zeros(120, 200, CV_8U);
  const cv::Rect left{25, 30, 40, 40}, right{125, 30, 40, 40};

  Ground() {
    cv::RNG random(1);
    cv::Mat grain(picture.size(), CV_32FC3);
    random.fill(grain, cv::RNG::NORMAL, 0.0, 12.0);
    picture += grain;
    sun(left).setTo(0.0f), sun(right).setTo(0.0f);
  }
  SeenShadows seen() const { return seenShadows(sun, sky, picture, unknown); }
};

TEST(SeenShadows, BelievesAWholeShadowThatIsDarkFromItsBorderOn) {
  Ground g;
  g.picture(g.left) *= 0.8f;
  const SeenShadows s = g.seen();
  EXPECT_EQ(cv::countNonZero(s.sun(g.left)), g.left.area());
  EXPECT_EQ(cv::countNonZero(s.sun(g.right)), 0);
  EXPECT_EQ(cv::countNonZero(s.refuted), g.right.area());
  EXPECT_FALSE(s.none);
}

TEST(SeenShadows, ShadowsBesideTheirPlaceAreStillSeen) {
  Ground g;  // light and model are off by some pixels
  g.picture(g.left + cv::Point(4, 3)) *= 0.7f;
  EXPECT_EQ(cv::countNonZero(g.seen().sun(g.left)), g.left.area());
}

TEST(SeenShadows, GettingDarkerIsNoShadow) {
  Ground g;  // towards the prediction's middle, without an edge at its border
  for (int v = 0; v < g.picture.rows; ++v) {
    for (int u = 0; u < g.picture.cols; ++u) {
      const float x = static_cast<float>(u - 45) / 40.0f, y = static_cast<float>(v - 50) / 40.0f;
      g.picture.at<cv::Vec3f>(v, u) *= 1.0f - 0.4f * std::exp(-(x * x + y * y) / 2.0f);
    }
  }
  const SeenShadows s = g.seen();
  EXPECT_EQ(cv::countNonZero(s.sun), 0);
  EXPECT_TRUE(s.none);
}

TEST(SeenShadows, WhatCannotBeComparedFollowsWhatCan) {
  Ground g;
  g.unknown.colRange(0, 100).setTo(255);
  EXPECT_EQ(cv::countNonZero(g.seen().sun), 0);
  g.picture(g.right) *= 0.7f;
  EXPECT_EQ(cv::countNonZero(g.seen().sun(g.left)), g.left.area());
  // Where nothing at all can be compared, predictions are believed.
  g.unknown.setTo(255);
  EXPECT_EQ(cv::countNonZero(g.seen().sun), 2 * g.left.area());
}

TEST(SeenShadows, OfAnUnsureSunThoseThatShowAreBelieved) {
  Ground g;
  g.picture(g.left) *= 0.88f;  // may be a pale shadow, or another thing: undecided
  g.unknown.colRange(100, 200).setTo(255);
  g.sky(g.left).setTo(0.4f);  // whose dark speaks for a shadow no more
  const auto seen = [&](bool sun_is_sure) {
    return seenShadows(g.sun, g.sky, g.picture, g.unknown, kOnGround, sun_is_sure);
  };
  EXPECT_EQ(cv::countNonZero(seen(true).sun), 2 * g.left.area());
  EXPECT_EQ(cv::countNonZero(seen(false).sun), 0);
  EXPECT_TRUE(seen(false).no_sun);
  g.picture(g.left) *= 0.8f;
  EXPECT_EQ(cv::countNonZero(seen(false).sun(g.left)), g.left.area());
  // Where nothing at all can be compared, predictions are believed.
  g.unknown.setTo(255);
  EXPECT_EQ(cv::countNonZero(seen(false).sun), 2 * g.left.area());
}

// Of a sun's shadow too little is seen to tell; the sky's, a little too pale, is undecided.
TEST(SeenShadows, OfWhichNothingIsToldAreBelievedUnlessOthersSurelySpeakAgainst) {
  Ground g;
  g.sun(g.right).setTo(1.0f);
  g.unknown.colRange(0, 100).setTo(255);
  g.sky(g.right).setTo(0.4f);
  g.picture(g.right) *= 0.95f;
  const auto seen = [&] {
    return seenShadows(g.sun, g.sky, g.picture, g.unknown, kOnGround, false);
  };
  EXPECT_EQ(cv::countNonZero(seen().sun), g.left.area());
  EXPECT_EQ(cv::countNonZero(seen().sky), 0);
  g.picture(g.right) *= 1.0f / 0.95f;  // nothing of it is seen
  EXPECT_EQ(cv::countNonZero(seen().sun), 0);
}

TEST(SeenShadows, OnWaterPaleOnesCount) {
  Ground g;  // a quarter of the light, as most of what is seen is mirrored; beside it none
  g.picture(g.left) *= 0.88f;
  const SeenShadows on_water = seenShadows(g.sun, g.sky, g.picture, g.unknown, kOnWater);
  EXPECT_EQ(cv::countNonZero(on_water.sun(g.left)), g.left.area());
  EXPECT_EQ(cv::countNonZero(on_water.refuted), g.right.area());
  EXPECT_TRUE(g.seen().none);
}

TEST(SeenShadows, TheHiddenSkyIsAskedLikewise) {
  Ground g;
  g.sun.setTo(1.0f);
  g.sky(g.left).setTo(0.4f), g.sky(g.right).setTo(0.4f);
  g.picture(g.right) *= 0.75f;
  const SeenShadows s = g.seen();
  EXPECT_EQ(cv::countNonZero(s.sky(g.left)), 0);
  EXPECT_EQ(cv::countNonZero(s.sky(g.right)), g.right.area());
  EXPECT_EQ(cv::countNonZero(s.sun), 0);
}

}  // namespace
}  // namespace calipso::render
