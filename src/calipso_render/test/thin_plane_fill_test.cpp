// The thin part of a plane, between others that look unlike it.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

constexpr int kSide = 200;
constexpr int kApex = 30;  // row in which it begins
constexpr double kDark = 60.0, kPale = 160.0;

// A dark wedge that widens downwards on a pale ground, its upper part hidden.
struct Wedge {
  cv::Mat surface = cv::Mat(kSide, kSide, CV_8U, cv::Scalar(1)), picture, hole;

  Wedge() {
    cv::fillConvexPoly(surface, std::vector<cv::Point>{{100, kApex}, {84, 199}, {116, 199}},
                       cv::Scalar(2));
    picture = 0.05 * grain(kSide, kSide) + cv::Scalar::all(kPale);
    const cv::Mat dark = 0.05 * grain(kSide, kSide) + cv::Scalar::all(kDark);
    dark.copyTo(picture, surface == 2);
    hole = cv::Mat::zeros(kSide, kSide, CV_8U);
    hole(cv::Rect(60, 15, 80, 115)).setTo(255);
    picture.setTo(cv::Scalar::all(0), hole);
  }
};

TEST(Inpaint, AThinPartOfAPlaneComesFromThatPlane) {
  const Wedge wedge;
  InpaintParams params;
  params.surface = wedge.surface;
  const InpaintResult result = inpaint(wedge.picture, wedge.hole, cv::Mat(), params);
  const cv::Mat hidden = wedge.hole & (wedge.surface == 2);
  int foreign = 0;
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      if (hidden.at<std::uint8_t>(v, u) == 0) continue;
      const cv::Vec2s from = result.origin.at<cv::Vec2s>(v, u);
      foreign += from[0] < 0 || wedge.surface.at<std::uint8_t>(from[1], from[0]) != 2;
    }
  }
  // Patches at its outline see more of the ground than of it.
  EXPECT_LT(foreign, cv::countNonZero(hidden) / 20);
}

}  // namespace
}  // namespace calipso::render
