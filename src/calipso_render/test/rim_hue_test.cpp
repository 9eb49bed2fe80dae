#include "texture/rim_hue.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

const cv::Scalar kObject(170.0, 110.0, 40.0), kAround(60.0, 120.0, 190.0);

// As videos are coded: hue at half the size.
cv::Mat coded(const cv::Mat& picture) {
  cv::Mat all, half;
  cv::cvtColor(picture, all, cv::COLOR_BGR2YCrCb);
  cv::resize(all, half, {}, 0.5, 0.5, cv::INTER_AREA);
  cv::resize(half, half, all.size(), 0, 0, cv::INTER_LINEAR);
  cv::Mat mixed(all.size(), all.type()), out;
  for (const int channel : {0, 1, 2}) {
    const int same[] = {channel, channel};
    cv::mixChannels(channel == 0 ? all : half, mixed, same, 1);
  }
  cv::cvtColor(mixed, out, cv::COLOR_YCrCb2BGR);
  return out;
}

double errorIn(const cv::Mat& codes, const cv::Mat& where) {
  cv::Mat off;
  cv::absdiff(codes, kObject, off);
  const cv::Scalar mean = cv::mean(off, where);
  return mean[0] + mean[1] + mean[2];
}

TEST(RimHue, IsWithoutThatOfTheSurroundings) {
  cv::Mat mask = cv::Mat::zeros(90, 100, CV_8U), picture(mask.size(), CV_8UC3, kAround), codes;
  cv::circle(mask, {50, 44}, 30, 255, cv::FILLED);
  picture.setTo(kObject, mask);
  coded(picture).convertTo(codes, CV_32F);
  cv::Mat inside;
  cv::erode(mask, inside, cv::Mat::ones(7, 7, CV_8U));
  const cv::Mat rim = mask & (inside == 0), before = codes.clone();
  const double mixed = errorIn(codes, rim);
  EXPECT_GT(mixed, 15.0);
  unmixHue(mask, codes);
  EXPECT_LT(errorIn(codes, rim), 0.6 * mixed);
  EXPECT_LT(errorIn(codes, inside), 3.0);
  EXPECT_EQ(cv::norm(codes, before, cv::NORM_INF, mask == 0), 0.0);
}

TEST(RimHue, StaysWhereNothingIsAround) {
  cv::Mat codes(20, 30, CV_32FC3, kObject);
  unmixHue(cv::Mat(codes.size(), CV_8U, cv::Scalar(255)), codes);
  EXPECT_EQ(errorIn(codes, cv::Mat(codes.size(), CV_8U, cv::Scalar(255))), 0.0);
}

}  // namespace
}  // namespace calipso::render
