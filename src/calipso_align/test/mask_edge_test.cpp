#include "calipso_align/mask_edge.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using testing::disc;
using testing::intersectionOverUnion;
using testing::maskOf;
using testing::paint;

const cv::Size kSize(120, 100);
const cv::Vec3b kDark(60, 70, 50), kLight(190, 180, 200);
const testing::SignedDistance kDisc = disc(60.37, 49.61, 30.42);

TEST(MaskEdge, PixelsWhoseCentreIsCoveredAreTheObjects) {
  const cv::Mat image = paint(kSize, kDisc, kDark, kLight, 2.0), truth = maskOf(kSize, kDisc);
  for (const double error : {-0.7, 0.7}) {
    cv::Mat mask = maskOf(kSize, disc(60.37, 49.61, 30.42 + error));
    const double before = intersectionOverUnion(mask, truth);
    settleEdge(image, {}, 2.0, mask);
    // Seven tenths of a pixel all around cost 4.6 %.
    EXPECT_LT(before, 0.96);
    EXPECT_GE(intersectionOverUnion(mask, truth), 0.995) << error;
  }
}

TEST(MaskEdge, CoverageIsTheShareOfThePixel) {
  const cv::Mat image = paint(kSize, kDisc, kDark, kLight, 0.0);
  cv::Mat mask = maskOf(kSize, kDisc);
  const cv::Mat coverage = settleEdge(image, {}, 2.0, mask);
  for (int x = 25; x < 36; ++x)
    EXPECT_NEAR(coverage.at<uchar>(50, x) / 255.0, std::clamp(0.5 - kDisc(x, 50), 0.0, 1.0), 0.03)
        << x;
}

TEST(MaskEdge, WithoutContrastTheMaskStays) {
  cv::Mat mask = maskOf(kSize, kDisc);
  const cv::Mat before = mask.clone();
  settleEdge(cv::Mat(kSize, CV_8UC3, cv::Scalar(90, 90, 90)), {}, 2.0, mask);
  EXPECT_EQ(cv::countNonZero(mask != before), 0);
}

TEST(WithoutStrays, DropsWhatIsElsewhereUnlessItIsMostOfTheMask) {
  cv::Mat mask = cv::Mat::zeros(60, 100, CV_8U), expected = mask.clone();
  const cv::Rect object(10, 10, 20, 20), stray(70, 30, 10, 10);
  mask(object).setTo(255);
  mask(stray).setTo(255);
  expected(cv::Rect(25, 10, 20, 20)).setTo(255);  // meets the object at its side only
  const cv::Mat kept = withoutStrays(mask, expected);
  EXPECT_EQ(cv::countNonZero(kept(object)), object.area());
  EXPECT_EQ(cv::countNonZero(kept(stray)), 0);
  expected.setTo(0);
  expected(stray).setTo(255);  // it has gone elsewhere in a jump
  EXPECT_EQ(cv::countNonZero(withoutStrays(mask, expected) != mask), 0);
}

}  // namespace
}  // namespace calipso::align
