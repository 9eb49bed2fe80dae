#include "calipso_render/inpaint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "offset_statistics.hpp"
#include "seam_blend.hpp"
#include "shift_cut.hpp"

namespace calipso::render {
namespace {

// Grain without any repetition, the same in every run.
cv::Mat grain(int width, int height) {
  cv::Mat image(height, width, CV_32FC3);
  cv::RNG random(11);
  random.fill(image, cv::RNG::UNIFORM, 40.0, 200.0);
  return image;
}

// Its left part again at the right, `period` px on.
cv::Mat repeated(int width, int height, int period) {
  cv::Mat image = grain(width, height);
  for (int u = period; u < width; ++u) image.col(u - period).copyTo(image.col(u));
  return image;
}

double meanDifference(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference, mask);
  return (mean[0] + mean[1] + mean[2]) / 3.0;
}

TEST(DominantOffsets, FindsThePeriodOfAPicture) {
  const cv::Mat image = repeated(120, 60, 37), source(60, 120, CV_8U, cv::Scalar(255)), hole = cv::Mat::zeros(60, 120, CV_8U);
  const std::vector<cv::Point> offsets = dominantOffsets(image, source, source, 8.0, 2, 1);
  ASSERT_EQ(offsets.size(), 2u);
  for (const cv::Point& o : offsets) EXPECT_TRUE(o == cv::Point(37, 0) || o == cv::Point(-37, 0)) << o;
}

TEST(DominantOffsets, HasNoneWhereNoPatchIsWhole) {
  const cv::Mat image = grain(40, 40), source = cv::Mat::zeros(40, 40, CV_8U);
  EXPECT_TRUE(dominantOffsets(image, source, source == 0, 4.0, 5, 1).empty());
}

TEST(LevelOffsets, FollowALineThatFalls) {
  // A dark line that falls by 1 px in 12 on a bright ground, hidden in the middle.
  cv::Mat image(80, 160, CV_32FC3, cv::Scalar::all(160)), hole = cv::Mat::zeros(80, 160, CV_8U);
  for (int u = 0; u < 160; ++u) image(cv::Rect(u, 30 + u / 12, 1, 3)).setTo(cv::Scalar::all(30));
  hole(cv::Rect(60, 15, 40, 50)).setTo(255);
  const std::vector<cv::Point> offsets = levelOffsets(image, hole == 0, hole, 8);
  ASSERT_FALSE(offsets.empty());
  for (const cv::Point& o : offsets) EXPECT_NEAR(o.y, o.x / 12.0, 1.0) << o;
}

TEST(ShiftCut, TakesTheOnlyShiftThatContinuesThePicture) {
  const cv::Mat image = repeated(90, 60, 30);
  cv::Mat hole = cv::Mat::zeros(60, 90, CV_8U);
  hole(cv::Rect(40, 20, 16, 16)).setTo(255);
  ShiftCut cut(image, hole, hole == 0, {{-25, 3}, {30, 0}, {17, -9}}, 1.0f);
  cut.start();
  cut.sweep(-1);
  EXPECT_EQ(cv::countNonZero((cut.labels() != 1) & hole), 0);
  EXPECT_EQ(cv::countNonZero((cut.labels() != ShiftCut::kNone) & (hole == 0)), 0);
}

TEST(ShiftCut, ASeamRunsWhereItShowsLeast) {
  // Two shifts, left and right, that agree on one column alone: there the seam must be.
  cv::Mat image = grain(120, 24), hole = cv::Mat::zeros(24, 120, CV_8U);
  hole(cv::Rect(50, 0, 20, 24)).setTo(255);
  for (int v = 0; v < 24; ++v) {
    for (int u = 60; u < 62; ++u) image.at<cv::Vec3f>(v, u - 40) = image.at<cv::Vec3f>(v, u + 40);
  }
  // Each shift continues its own side of the hole.
  image(cv::Rect(6, 0, 4, 24)).copyTo(image(cv::Rect(46, 0, 4, 24)));
  image(cv::Rect(110, 0, 4, 24)).copyTo(image(cv::Rect(70, 0, 4, 24)));
  ShiftCut cut(image, hole, hole == 0, {{-40, 0}, {40, 0}}, 1.0f);
  cut.start();
  cut.sweep(-1);
  cut.sweep(-1);
  for (int v = 0; v < 24; ++v) {
    for (int u = 50; u < 70; ++u) EXPECT_EQ(int(cut.labels().at<std::uint8_t>(v, u)), u <= 60 ? 0 : 1) << u << ", " << v;
  }
}

TEST(BlendSeams, SpreadsAStepAndKeepsTheGrain) {
  // A copy of the left part, 3 code values too dark, between two parts that fit.
  const cv::Mat truth = repeated(120, 30, 40);
  cv::Mat hole = cv::Mat::zeros(30, 120, CV_8U), origin(30, 120, CV_16SC2, cv::Scalar(-1, -1)), image = truth.clone();
  hole(cv::Rect(50, 5, 20, 20)).setTo(255);
  for (int v = 5; v < 25; ++v) {
    for (int u = 50; u < 70; ++u) origin.at<cv::Vec2s>(v, u) = cv::Vec2s(short(u - 40), short(v));
  }
  const cv::Mat exact = image.clone();
  blendSeams(hole, hole == 0, origin, image);
  EXPECT_LT(cv::norm(image, exact, cv::NORM_INF), 1e-3);  // what fits stays
  cv::subtract(image, cv::Scalar::all(3.0), image, hole);
  blendSeams(hole, hole == 0, origin, image);
  EXPECT_LT(meanDifference(image, truth, hole), 0.5);
}

TEST(Inpaint, ContinuesWhatRepeatsItself) {
  const cv::Mat truth = repeated(160, 120, 53);
  cv::Mat image = truth.clone(), hole = cv::Mat::zeros(120, 160, CV_8U);
  hole(cv::Rect(60, 40, 30, 30)).setTo(255);
  image.setTo(cv::Scalar::all(0), hole);
  const InpaintResult r = inpaint(image, hole, cv::Mat());
  EXPECT_TRUE(r.patches_found);
  EXPECT_LT(meanDifference(r.image, truth, hole), 2.0);
  EXPECT_EQ(cv::norm(r.image, image, cv::NORM_INF, hole == 0), 0.0);
}

TEST(Inpaint, CopiesFromNoBannedPlace) {
  const cv::Mat image = grain(120, 90);
  cv::Mat hole = cv::Mat::zeros(90, 120, CV_8U), banned = cv::Mat::zeros(90, 120, CV_8U);
  hole(cv::Rect(50, 30, 20, 20)).setTo(255);
  banned(cv::Rect(0, 0, 40, 90)).setTo(255);
  const InpaintResult r = inpaint(image, hole, banned);
  for (int v = 30; v < 50; ++v) {
    for (int u = 50; u < 70; ++u) {
      const cv::Vec2s from = r.origin.at<cv::Vec2s>(v, u);
      ASSERT_GE(from[0], 40);
      ASSERT_EQ(hole.at<std::uint8_t>(from[1], from[0]), 0);
    }
  }
}

TEST(Inpaint, SaysWhenThereIsNothingToCopy) {
  const cv::Mat image(20, 20, CV_32FC3, cv::Scalar::all(50)), hole(20, 20, CV_8U, cv::Scalar(255));
  EXPECT_FALSE(inpaint(image, hole, cv::Mat()).patches_found);
}

}  // namespace
}  // namespace calipso::render
