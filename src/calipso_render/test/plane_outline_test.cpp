// Straight outlines of planes that run into what hides them.

#include "place/plane_outline.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {
namespace {

constexpr int kWide = 240, kHigh = 160;

// A plane of any shape, farther things around it, and an object before both.
struct Setting {
  cv::Mat plane = cv::Mat::zeros(kHigh, kWide, CV_8U), hidden = plane.clone();

  cv::Mat within() const {
    const cv::Mat on = plane & ~hidden, absent = ~plane & ~hidden;
    cv::Mat to_on, to_absent;
    cv::distanceTransform(on == 0, to_on, cv::DIST_L2, cv::DIST_MASK_5);
    cv::distanceTransform(absent == 0, to_absent, cv::DIST_L2, cv::DIST_MASK_5);
    return withinOutlines(on, absent, to_on, to_absent, hidden);
  }
};

Setting behindDisc(const std::vector<cv::Point>& corners, const cv::Point& centre, int radius) {
  Setting s;
  cv::fillConvexPoly(s.plane, corners, 255);
  cv::circle(s.hidden, centre, radius, 255, cv::FILLED);
  return s;
}

// Part of what is hidden that is told wrong.
double wrong(const Setting& s, const cv::Mat& within) {
  return static_cast<double>(cv::countNonZero((within != s.plane) & s.hidden)) /
         cv::countNonZero(s.hidden);
}

TEST(PlaneOutline, AnEdgeThatEntersOnBothSidesGoesStraightThrough) {
  const Setting s =
      behindDisc({{0, 70}, {kWide - 1, 82}, {kWide - 1, kHigh - 1}, {0, kHigh - 1}}, {120, 75}, 35);
  const cv::Mat within = s.within();
  ASSERT_FALSE(within.empty());
  EXPECT_LT(wrong(s, within), 0.03);
}

TEST(PlaneOutline, TwoEdgesMeetAtACornerThatNobodySees) {
  const Setting s =
      behindDisc({{0, 60}, {150, 66}, {180, kHigh - 1}, {0, kHigh - 1}}, {148, 70}, 30);
  const cv::Mat within = s.within();
  ASSERT_FALSE(within.empty());
  EXPECT_LT(wrong(s, within), 0.04);
}

// A corner that is seen near the object is no sign that the edge before it bends.
TEST(PlaneOutline, AnEdgeEndsAtACornerThatIsSeen) {
  const Setting s =
      behindDisc({{20, 62}, {172, 60}, {230, 85}, {230, 130}, {20, 130}}, {120, 65}, 35);
  const cv::Mat within = s.within();
  ASSERT_FALSE(within.empty());
  EXPECT_LT(wrong(s, within), 0.04);
}

TEST(PlaneOutline, WhatIsRoundHasNone) {
  Setting s;
  cv::circle(s.plane, {120, 90}, 60, 255, cv::FILLED);
  cv::circle(s.hidden, {120, 30}, 22, 255, cv::FILLED);
  EXPECT_TRUE(s.within().empty());
}

TEST(PlaneOutline, NoneHoldsAcrossWhatIsSeenBesideThePlane) {
  // A step: its upper level goes on where something farther is seen, its lower one cuts it off.
  Setting s;
  s.plane(cv::Rect(0, 60, 120, kHigh - 60)).setTo(255);
  s.plane(cv::Rect(120, 90, 120, kHigh - 90)).setTo(255);
  cv::circle(s.hidden, {120, 75}, 25, 255, cv::FILLED);
  EXPECT_TRUE(s.within().empty());
}

}  // namespace
}  // namespace calipso::render
