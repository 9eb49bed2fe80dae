#include "calipso_align/layer_motion.hpp"

#include <gtest/gtest.h>

namespace calipso::align {
namespace {

const cv::Size kSize(120, 90);
const cv::Rect kWhole(cv::Point(), kSize);

cv::Vec2f affine(int x, int y) {
  return {1.5f + 0.02f * static_cast<float>(x) - 0.01f * static_cast<float>(y),
          -0.7f + 0.03f * static_cast<float>(y)};
}

cv::Mat support() {
  cv::Mat mask = cv::Mat::zeros(kSize, CV_8U);
  mask(cv::Rect(40, 30, 40, 30)).setTo(255);
  return mask;
}

TEST(LayerMotion, ContinuesAnAffineMotionBeyondItsSupport) {
  cv::Mat flow(kSize, CV_32FC2);
  for (int y = 0; y < kSize.height; ++y)
    for (int x = 0; x < kSize.width; ++x)
      flow.at<cv::Vec2f>(y, x) = support().at<uchar>(y, x) ? affine(x, y) : cv::Vec2f(20, 20);
  const cv::Mat motion = layerMotion(flow, support(), kWhole);
  for (const cv::Point p : {cv::Point(60, 45), cv::Point(30, 20), cv::Point(110, 80)})
    EXPECT_LT(cv::norm(motion.at<cv::Vec2f>(p) - affine(p.x, p.y)), 0.02) << p;
}

TEST(LayerMotion, AnotherMotionInAQuarterOfTheSupportDoesNotBendTheRest) {
  cv::Mat flow(kSize, CV_32FC2, cv::Scalar(3, -2));
  flow(cv::Rect(40, 30, 10, 30)).setTo(cv::Scalar(-6, 5));
  const cv::Mat motion = layerMotion(flow, support(), kWhole);
  EXPECT_LT(cv::norm(motion.at<cv::Vec2f>(45, 95) - cv::Vec2f(3, -2)), 0.2);
}

TEST(LayerMotion, WithoutSupportNothingMoves) {
  const cv::Mat flow(kSize, CV_32FC2, cv::Scalar(3, -2));
  EXPECT_EQ(cv::norm(layerMotion(flow, cv::Mat::zeros(kSize, CV_8U), kWhole), cv::NORM_INF), 0.0);
}

TEST(LayerMotion, MovedBackUndoesATranslation) {
  cv::Mat image = cv::Mat::zeros(kSize, CV_8U);
  image.at<uchar>(40, 50) = 200;
  const cv::Rect roi(30, 20, 60, 50);
  const cv::Mat moved = movedBack(image, cv::Mat(roi.size(), CV_32FC2, cv::Scalar(-4, -3)), roi);
  EXPECT_EQ(moved.at<uchar>(43 - roi.y, 54 - roi.x), 200);
}

}  // namespace
}  // namespace calipso::align
