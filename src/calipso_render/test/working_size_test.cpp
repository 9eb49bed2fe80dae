#include "working_size.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

TEST(WorkingSize, IsOneOfAbout640Pixels) {
  for (const int side : {1, 640, 960}) EXPECT_EQ(timesTooLarge({side, side / 2 + 1}), 1) << side;
  EXPECT_EQ(timesTooLarge({961, 540}), 2);
  EXPECT_EQ(timesTooLarge({720, 1280}), 2);
  EXPECT_EQ(timesTooLarge({1920, 1080}), 3);
}

TEST(WorkingSize, ValuesAreThoseOfTheSquaresMiddles) {
  const int times = 3;
  cv::Mat picture(2 * times + 1, 4 * times + 2, CV_32FC2);
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u)
      picture.at<cv::Vec2f>(v, u) = cv::Vec2f(static_cast<float>(u), static_cast<float>(v));
  }
  const cv::Mat values = reducedValues(picture, times), means = reducedMeans(picture, times);
  ASSERT_EQ(values.size(), cv::Size(4, 2));
  // The mean of a slope is what it has in the middle, too.
  EXPECT_LT(cv::norm(values, means, cv::NORM_INF), 1e-4);
}

TEST(WorkingSize, WhatIsToldThereIsEnlargedToWhereItWas) {
  for (const int times : {2, 3}) {
    // An edge far from the first column, in a picture that ends within a square.
    const int edge = 600 * times;
    cv::Mat mask = cv::Mat::zeros(9 * times + 1, 640 * times + times - 1, CV_8U);
    mask.colRange(edge, mask.cols).setTo(255);
    const cv::Mat again =
        enlargedAgain(reducedValues(mask, times), mask.size(), times, cv::INTER_NEAREST);
    EXPECT_EQ(cv::norm(again, mask, cv::NORM_INF), 0.0) << times;
  }
}

TEST(WorkingSize, NothingStaysNothing) {
  EXPECT_TRUE(reducedMeans({}, 2).empty());
  EXPECT_TRUE(reducedValues({}, 2).empty());
}

}  // namespace
}  // namespace calipso::render
