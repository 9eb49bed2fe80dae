#include "place/rim_remains.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

constexpr int kMargin = 3;

// A red disc on grain; its footprint misses a stretch of its rim by six pixels.
struct Disc {
  cv::Mat picture = 0.2 * testing::grain(160, 120), footprint = cv::Mat::zeros(120, 160, CV_8U),
          others = footprint.clone();

  Disc() {
    cv::circle(picture, {80, 60}, 30, {20, 20, 220}, cv::FILLED);
    cv::circle(footprint, {80, 60}, 30, 255, cv::FILLED);
    footprint(cv::Rect(105, 50, 40, 20)) = 0;
  }
  cv::Mat remains() const { return rimRemains(picture, footprint, others, kMargin); }
};

TEST(RimRemains, AreWhatLooksLikeNothingFartherOut) {
  const Disc disc;
  const cv::Mat remains = disc.remains();
  EXPECT_NE(remains.at<std::uint8_t>(60, 109), 0);
  EXPECT_GT(cv::countNonZero(remains), 30);
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      if (remains.at<std::uint8_t>(v, u) == 0) continue;
      ASSERT_GT(disc.picture.at<cv::Vec3f>(v, u)[2], 200.0f) << u << ", " << v;
    }
  }
}

TEST(RimRemains, AreNotWhatIsSeenAroundAsWell) {
  Disc disc;
  disc.picture(cv::Rect(100, 45, 60, 30)).setTo(cv::Scalar(20, 20, 220));  // goes on
  EXPECT_EQ(cv::countNonZero(disc.remains()), 0);
}

TEST(RimRemains, AreNotPartsOfOtherObjects) {
  Disc disc;
  disc.others(cv::Rect(105, 50, 40, 20)) = 255;
  EXPECT_EQ(cv::countNonZero(disc.remains()), 0);
}

}  // namespace
}  // namespace calipso::render
