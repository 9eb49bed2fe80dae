#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "fill/seam_blend.hpp"
#include "fill/seam_cut.hpp"
#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A hole at columns 100 to 139 that two copies fill, which are alike in columns 117 to 119 alone.
TEST(CutSeams, MoveToWhereCopiesAreAlike) {
  cv::Mat image = grain(240, 24);
  const int way = 60, first = 100, last = 139;
  for (int u = 117; u <= 119; ++u) image.col(u - way).copyTo(image.col(u + way));
  image.col(first - 1).copyTo(image.col(first - 1 - way));
  image.col(last + 1).copyTo(image.col(last + 1 + way));
  cv::Mat hole = cv::Mat::zeros(image.size(), CV_8U), origin(image.size(), CV_16SC2, {-1, -1});
  hole.colRange(first, last + 1).setTo(255);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = first; u <= last; ++u)
      origin.at<cv::Vec2s>(v, u) = {static_cast<short>(u < 113 ? u - way : u + way),
                                    static_cast<short>(v)};
  }
  cutSeams(image, hole, hole == 0, hole == 0, InpaintParams(), origin);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = first; u <= last; ++u) {
      const bool from_left = origin.at<cv::Vec2s>(v, u)[0] < u;
      const bool alike = u >= 117 && u <= 119;
      EXPECT_TRUE(alike || from_left == (u < 117)) << u << ", " << v;
    }
  }
}

// A row of a picture whose left half is darker by a step, blended.
std::vector<float> blendedStep(float step, const cv::Mat& planes, const cv::Mat& sky = {}) {
  cv::Mat image(40, 120, CV_32FC3, cv::Scalar::all(50)), hole = cv::Mat::zeros(40, 120, CV_8U);
  image.colRange(60, 120).setTo(cv::Scalar::all(50.0 + step));
  hole.colRange(30, 90).setTo(255);
  cv::Mat origin(40, 120, CV_16SC2, {-1, -1}), row;
  for (int v = 0; v < 40; ++v) {
    for (int u = 30; u < 90; ++u)
      origin.at<cv::Vec2s>(v, u) = {static_cast<short>(u < 60 ? 10 : 105), static_cast<short>(v)};
  }
  blendSeams(hole, hole == 0, origin, planes, sky, image);
  cv::extractChannel(image.row(20), row, 0);
  return row;
}

// A step that is too high for a seam keeps its place, but not its edge.
TEST(BlendSeams, SoftenAStepBetweenThings) {
  const std::vector<float> at = blendedStep(150.0f, cv::Mat());
  EXPECT_LT(at[60] - at[59], 75.0f);
  EXPECT_NEAR(at[50], 50.0f, 12.0f);
  EXPECT_NEAR(at[70], 200.0f, 12.0f);
}

TEST(BlendSeams, SpreadAnyStepInTheSky) {
  const cv::Mat sky(40, 120, CV_8U, cv::Scalar(InpaintParams::kSky));
  const std::vector<float> at = blendedStep(60.0f, cv::Mat(), sky);
  for (int u = 1; u < 120; ++u) EXPECT_LT(at[u] - at[u - 1], 6.0f) << u;
}

TEST(BlendSeams, KeepTheEdgeBetweenPlanes) {
  cv::Mat planes(40, 120, CV_8U, cv::Scalar(1));
  planes.colRange(60, 120).setTo(2);
  for (const float step : {10.0f, 150.0f})
    EXPECT_NEAR(blendedStep(step, planes)[60] - blendedStep(step, planes)[59], step, 1e-3f);
}

// Of one surface, as water is that mirrors darker things here and brighter ones there: the fill is 45
// code values too bright all along the border. A single stripe that ends at it is an edge.
TEST(BlendSeams, SpreadWhatIsMissedAllAlongASurfacesBorder) {
  const auto blended = [](const cv::Rect& dark, const cv::Mat& planes) {
    cv::Mat image(60, 120, CV_32FC3, cv::Scalar::all(100)), hole = cv::Mat::zeros(60, 120, CV_8U);
    hole.colRange(40, 80).setTo(255);
    image(dark).setTo(cv::Scalar::all(55));
    cv::Mat origin(60, 120, CV_16SC2, {-1, -1}), row;
    for (int v = 0; v < 60; ++v) {
      for (int u = 40; u < 80; ++u) origin.at<cv::Vec2s>(v, u) = {100, static_cast<short>(v)};
    }
    blendSeams(hole, hole == 0, origin, planes, {}, image);
    cv::extractChannel(image.row(30), row, 0);
    return std::vector<float>(row.begin<float>(), row.end<float>());
  };
  const cv::Mat one(60, 120, CV_8U, cv::Scalar(1));
  const cv::Rect all(0, 0, 40, 60), stripe(0, 29, 40, 2);
  EXPECT_LT(blended(all, one)[40], 60.0f);
  EXPECT_LT(blended(all, one)[45], 80.0f);
  EXPECT_GT(blended(all, cv::Mat())[45], 90.0f);
  EXPECT_GT(blended(stripe, one)[45], 90.0f);
}

TEST(BlendSeams, SpreadsAStepAndKeepsTheGrain) {
  // A copy of the left part, 3 code values too dark, between two parts that fit.
  const cv::Mat truth = repeated(grain(120, 30), 40);
  cv::Mat hole = cv::Mat::zeros(30, 120, CV_8U), origin(30, 120, CV_16SC2, cv::Scalar(-1, -1)),
          image = truth.clone();
  hole(cv::Rect(50, 5, 20, 20)).setTo(255);
  for (int v = 5; v < 25; ++v) {
    for (int u = 50; u < 70; ++u) origin.at<cv::Vec2s>(v, u) = cv::Vec2s(short(u - 40), short(v));
  }
  const cv::Mat exact = image.clone();
  blendSeams(hole, hole == 0, origin, cv::Mat(), cv::Mat(), image);
  EXPECT_LT(cv::norm(image, exact, cv::NORM_INF), 1e-3);  // what fits stays
  cv::subtract(image, cv::Scalar::all(3.0), image, hole);
  blendSeams(hole, hole == 0, origin, cv::Mat(), cv::Mat(), image);
  EXPECT_LT(meanDifference(image, truth, hole), 0.5);
}

}  // namespace
}  // namespace calipso::render
