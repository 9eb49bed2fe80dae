#include "texture/pattern_motifs.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kSide = 120;
const cv::Scalar kDark(60, 60, 60), kBright(180, 180, 180), kRed(30, 30, 200);

// Squares of 6 px, dark and bright.
cv::Mat chequers() {
  cv::Mat picture(kSide, kSide, CV_32FC3, kDark);
  for (int v = 0; v < kSide; v += 6) {
    for (int u = 0; u < kSide; u += 6) {
      if ((u + v) / 6 % 2 == 0) picture(cv::Rect(u, v, 6, 6)).setTo(kBright);
    }
  }
  return picture;
}

int found(const cv::Mat& sample, const cv::Mat& picture) {
  const cv::Mat known(kSide, kSide, CV_8U, cv::Scalar(255));
  return cv::countNonZero(PatternMotifs(sample, known).in(picture, known));
}

TEST(PatternMotifs, ASingleThingIsOne) {
  cv::Mat picture = chequers();
  EXPECT_EQ(found(picture, picture), 0);
  cv::circle(picture, {50, 60}, 14, kRed, cv::FILLED);
  const cv::Mat known(kSide, kSide, CV_8U, cv::Scalar(255));
  const cv::Mat motif = PatternMotifs(picture, known).in(picture, known);
  const double area = M_PI * 14 * 14;
  EXPECT_GT(cv::countNonZero(motif), area);
  EXPECT_LT(cv::countNonZero(motif), 2.0 * area);
  EXPECT_NE(motif.at<std::uint8_t>(60, 50), 0);
}

TEST(PatternMotifs, SpotsAreOfThePattern) {
  cv::Mat picture = chequers();
  for (int v = 5; v < kSide; v += 23) {
    for (int u = 5; u < kSide; u += 17) cv::circle(picture, {u, v}, 1, kRed, cv::FILLED);
  }
  EXPECT_EQ(found(picture, picture), 0);
}

TEST(PatternMotifs, ABandThatGoesAcrossIsNone) {
  cv::Mat picture = chequers();
  picture.rowRange(40, 56).setTo(kRed);
  EXPECT_EQ(found(picture, picture), 0);
}

// Colours that the sample does not have are not told.
TEST(PatternMotifs, OfOtherColoursNothingIsSaid) {
  cv::Mat picture = chequers();
  cv::circle(picture, {50, 60}, 14, kRed, cv::FILLED);
  EXPECT_EQ(found(chequers(), picture), 0);
  EXPECT_GT(found(picture, picture), 0);
}

TEST(PatternMotifs, OfNothingKnownIsNone) {
  const cv::Mat none = cv::Mat::zeros(kSide, kSide, CV_8U);
  EXPECT_EQ(cv::countNonZero(PatternMotifs(chequers(), none).in(chequers(), none)), 0);
}

}  // namespace
}  // namespace calipso::render
