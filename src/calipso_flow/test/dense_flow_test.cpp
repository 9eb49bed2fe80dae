#include "calipso_flow/dense_flow.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::flow {
namespace {

cv::Mat texture(double dx, double dy) {
  cv::Mat image(120, 160, CV_8U);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double u = x - dx, v = y - dy;
      image.at<uchar>(y, x) = cv::saturate_cast<uchar>(
          128 + 50 * std::sin(0.3 * u) * std::cos(0.2 * v) + 40 * std::sin(0.11 * u + 0.23 * v));
    }
  }
  return image;
}

TEST(DenseFlow, findsATranslation) {
  DenseFlow flow(DenseFlow::Preset::kMedium);
  const cv::Mat found = flow.compute(texture(0, 0), texture(3, -2));
  const cv::Scalar mean = cv::mean(found(cv::Rect(30, 30, 100, 60)));
  EXPECT_NEAR(mean[0], 3.0, 0.1);
  EXPECT_NEAR(mean[1], -2.0, 0.1);
}

TEST(DenseFlow, isUnknownOutsideTheRegion) {
  DenseFlow flow(DenseFlow::Preset::kUltrafast);
  const cv::Rect region(40, 30, 60, 50);
  const cv::Mat found = flow.compute(texture(0, 0), texture(2, 1), region);
  EXPECT_TRUE(std::isnan(found.at<cv::Vec2f>(5, 5)[0]));
  EXPECT_NEAR(cv::mean(found(region))[0], 2.0, 0.2);
}

TEST(DenseFlow, refusesPicturesThatDiffer) {
  DenseFlow flow(DenseFlow::Preset::kUltrafast);
  EXPECT_THROW(flow.compute(texture(0, 0), cv::Mat(50, 50, CV_8U)), std::invalid_argument);
  EXPECT_THROW(flow.compute(cv::Mat(), cv::Mat()), std::invalid_argument);
  const cv::Mat deep(120, 160, CV_16U);
  EXPECT_THROW(flow.compute(deep, deep), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::flow
