#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

double gradientEnergy(const cv::Mat& picture, const cv::Mat& where) {
  cv::Mat grey, dx, dy;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  cv::filter2D(grey, dx, CV_32F, cv::Mat(cv::Matx13f(0, -1, 1)));
  cv::filter2D(grey, dy, CV_32F, cv::Mat(cv::Matx31f(0, -1, 1)));
  return cv::mean(dx.mul(dx) + dy.mul(dy), where)[0];
}

// A picture bland in most places and lively in some: what fills holes in it is of both, though bland
// copies resemble everything most.
TEST(Inpaint, LeansTowardsWhatIsLively) {
  cv::Mat strength;
  cv::GaussianBlur(grain(640, 480)(cv::Rect(320, 240, 320, 240)).clone(), strength, {0, 0}, 5.0);
  strength = cv::max(30.0 * (strength - cv::Scalar::all(121.5)), 0.0) / 100.0;
  const cv::Mat picture =
      (grain(320, 240) - cv::Scalar::all(120.0)).mul(strength) + cv::Scalar::all(120.0);
  const auto livelinessOf = [&](float off_bland) {
    InpaintParams params;
    params.off_bland = off_bland;
    double filled = 0.0;
    for (const cv::Point& at : {cv::Point(40, 40), cv::Point(120, 40), cv::Point(200, 40),
                                cv::Point(40, 120), cv::Point(120, 120), cv::Point(200, 120)}) {
      cv::Mat hole = cv::Mat::zeros(picture.size(), CV_8U);
      hole(cv::Rect(at, cv::Size(80, 80))).setTo(255);
      filled += gradientEnergy(inpaint(picture, hole, cv::Mat(), params).image, hole) / 6.0;
    }
    return filled / gradientEnergy(picture, cv::Mat());
  };
  EXPECT_GT(livelinessOf(1.0f), 1.2 * livelinessOf(0.0f));
  EXPECT_LT(livelinessOf(1.0f), 1.0);
}

}  // namespace
}  // namespace calipso::render
