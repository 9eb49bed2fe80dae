#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/background.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// Leaves whose depth is not known lie a pixel farther in every frame.
TEST(SharpenSeen, TakesTheEarliestViewOfWhatDoesNotLieOnItself) {
  cv::RNG random(3);
  cv::Mat leaves(kHeight, kWidth + 16, CV_8UC3);
  random.fill(leaves, cv::RNG::UNIFORM, 40, 200);
  cv::GaussianBlur(leaves, leaves, {}, 1.0);
  const cv::Rect object(40, 40, 16, 16), passing(80, 40, 16, 16);
  std::vector<ClipFrame> clip;
  for (int k = 0; k < 8; ++k) {
    clip.push_back({leaves(cv::Rect(k, 0, kWidth, kHeight)).clone(),
                    cv::Mat::zeros(kHeight, kWidth, CV_8U), camera()});
  }
  clip[0].labels(object).setTo(kBallLabel), clip[1].labels(object).setTo(kBallLabel);
  clip[0].bgr(passing).setTo(cv::Scalar::all(255));  // what is in one frame alone
  const BackgroundParams params;
  Background b = seenBackground(clip, false, params);
  const auto detail = [&](const cv::Rect& of) {
    cv::Mat gradient;
    cv::Sobel(b.plate(of), gradient, CV_32F, 1, 0);
    return cv::norm(gradient, cv::NORM_L2);
  };
  const cv::Rect beside(10, 10, 20, 20);
  const double blurred = detail(object);
  sharpenSeen(clip, params, b);
  EXPECT_GT(detail(object), 1.5 * blurred);
  // Most of it is the first frame's picture, or where that does not show it the third's.
  const auto same = [&](const cv::Rect& of, int frame) {
    cv::Mat plate, equal;
    b.plate(of).convertTo(plate, CV_8U);
    cv::absdiff(plate, clip[frame].bgr(of), plate);
    cv::inRange(plate, cv::Scalar::all(0), cv::Scalar::all(0), equal);
    return cv::countNonZero(equal) / static_cast<double>(of.area());
  };
  EXPECT_GT(same(beside, 0), 0.5);
  EXPECT_GT(same(cv::Rect(46, 46, 4, 4), 2), 0.5);
  EXPECT_LT(same(passing, 0), 0.1);
}

}  // namespace
}  // namespace calipso::render
