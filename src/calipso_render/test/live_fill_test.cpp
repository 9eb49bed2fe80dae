#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/background.hpp"

namespace calipso::render {
namespace {

// A grey picture with grain whose left half's copy, `step` code values darker, fills a hole in the
// right half.
struct LiveCase {
  cv::Mat frame = cv::Mat(60, 120, CV_8UC3), labels = cv::Mat::zeros(60, 120, CV_8U);
  LiveFill fill;
  // @param lift what is added to every copy
  explicit LiveCase(int step, double lift = 0.0) {
    cv::RNG random(3);
    random.fill(frame, cv::RNG::UNIFORM, 100, 110);
    cv::subtract(frame.colRange(0, 60), cv::Scalar::all(step), frame.colRange(0, 60));
    labels(cv::Rect(75, 15, 30, 30)).setTo(1);
    cv::Mat origin(60, 120, CV_16SC2, cv::Scalar(-1, -1));
    for (int v = 15; v < 45; ++v) {
      for (int u = 75; u < 105; ++u)
        origin.at<cv::Vec2s>(v, u) = cv::Vec2s(short(u - 65), short(v));
    }
    fill =
        LiveFill(origin, cv::Mat(60, 120, CV_32FC3, cv::Scalar::all(lift)), labels, frame, labels);
  }
};

TEST(LiveFill, CopiesAreLiftedToWhatTheirPlaceHas) {
  const LiveCase c(6, 6.0);  // by just what they lack: nothing is left to be drawn together
  const LiveFill::Corrections corrections = c.fill.corrections(c.frame, c.labels);
  cv::Vec3f sum;
  for (int v = 15; v < 45; ++v) {
    cv::Vec3f colour;
    ASSERT_TRUE(c.fill.at(c.frame, c.labels, corrections, 0.0f, 90, v, colour));
    sum += colour;
  }
  EXPECT_NEAR(sum[0] / 30, 105.0, 1.5) << "also in the middle, where the copy alone has 99";
}

TEST(LiveFill, CopiesTheFrameAtHandAndMeetsTheRim) {
  const LiveCase c(6);
  const LiveFill::Corrections corrections = c.fill.corrections(c.frame, c.labels);
  cv::Vec3f rim_sum, middle;
  for (int v = 15; v < 45; ++v) {
    cv::Vec3f colour;
    ASSERT_TRUE(c.fill.at(c.frame, c.labels, corrections, 0.0f, 75, v, colour));
    rim_sum += colour;
  }
  EXPECT_NEAR(rim_sum[0] / 30, 105.0, 2.0);  // the copy alone has 99
  ASSERT_TRUE(c.fill.at(c.frame, c.labels, corrections, 0.0f, 90, 30, middle));
  EXPECT_NEAR(middle[0], c.frame.at<cv::Vec3b>(30, 25)[0], 3.0);
}

TEST(LiveFill, StaysAsBrightAsItsSurroundingsWhenItsOriginDarkens) {
  LiveCase c(6);
  const int before = c.frame.at<cv::Vec3b>(30, 25)[0];
  cv::subtract(c.frame.colRange(0, 60), cv::Scalar::all(20), c.frame.colRange(0, 60));
  cv::Vec3f middle;
  ASSERT_TRUE(
      c.fill.at(c.frame, c.labels, c.fill.corrections(c.frame, c.labels), 0.0f, 90, 30, middle));
  EXPECT_NEAR(middle[0], before, 2.0);
}

// What of the deviation of noise and stripes, `amplitude` high, a copy has.
double contrastLeft(LiveCase c, float noise, int amplitude) {
  cv::Mat noisy = cv::Mat(c.frame.size(), CV_8UC3);
  cv::RNG(5).fill(noisy, cv::RNG::NORMAL, cv::Scalar::all(100), cv::Scalar::all(noise));
  for (int u = 0; u < noisy.cols; u += 4) noisy.colRange(u, u + 2) += cv::Scalar::all(amplitude);
  const LiveFill::Corrections corrections = c.fill.corrections(noisy, c.labels);
  cv::Mat filled(30, 30, CV_32F);
  for (int v = 0; v < 30; ++v) {
    for (int u = 0; u < 30; ++u) {
      cv::Vec3f colour;
      EXPECT_TRUE(c.fill.at(noisy, c.labels, corrections, noise, 75 + u, 15 + v, colour));
      filled.at<float>(v, u) = colour[1];
    }
  }
  cv::Scalar mean, deviation;
  cv::meanStdDev(filled.colRange(10, 20), mean, deviation);  // the seams' corrections have faded
  return deviation[0] / std::hypot(0.5 * amplitude, noise);
}

TEST(LiveFill, TakesNoiseOffAndLeavesTexture) {
  EXPECT_LT(contrastLeft(LiveCase(0), 2.0f, 0), 0.5);
  EXPECT_GT(contrastLeft(LiveCase(0), 2.0f, 8), 0.5);  // 1 - 2 * 4 / (16 + 4)
}

TEST(LiveFill, HasNothingWhereTheFrameHidesTheOrigin) {
  LiveCase c(0);
  c.labels(cv::Rect(10, 15, 30, 30)).setTo(2);
  cv::Vec3f colour;
  EXPECT_FALSE(
      c.fill.at(c.frame, c.labels, c.fill.corrections(c.frame, c.labels), 0.0f, 90, 30, colour));
  EXPECT_FALSE(
      c.fill.at(c.frame, c.labels, c.fill.corrections(c.frame, c.labels), 0.0f, 5, 5, colour));
}

}  // namespace
}  // namespace calipso::render
