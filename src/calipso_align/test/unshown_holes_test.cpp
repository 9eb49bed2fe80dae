#include "../src/unshown_holes.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace calipso::align {
namespace {

constexpr double kTolerancePx = 2.0;

cv::Mat1b plate() {
  cv::Mat1b mask = cv::Mat1b::zeros(100, 120);
  mask(cv::Rect(10, 10, 100, 80)).setTo(255);
  return mask;
}

cv::Mat1b plateWith(const cv::Rect& hole) {
  cv::Mat1b mask = plate();
  mask(hole).setTo(0);
  return mask;
}

TEST(UnshownHoles, AreThoseThatTheOtherHasNot) {
  const cv::Mat1b with = plateWith({40, 40, 12, 10});
  EXPECT_EQ(unshownHoles(with, plate(), kTolerancePx), 120.0);
  EXPECT_EQ(unshownHoles(plate(), with, kTolerancePx), 0.0);
  EXPECT_EQ(unshownHoles(with, with, kTolerancePx), 0.0);
}

TEST(UnshownHoles, MayBeOffByTheTolerance) {
  const cv::Mat1b with = plateWith({40, 40, 12, 10});
  EXPECT_EQ(unshownHoles(with, plateWith({42, 41, 12, 10}), kTolerancePx), 0.0);
  // One elsewhere is another.
  EXPECT_EQ(unshownHoles(with, plateWith({60, 40, 12, 10}), kTolerancePx), 120.0);
  // Mostly closed: what is left of it does not count.
  EXPECT_EQ(unshownHoles(with, plateWith({40, 40, 2, 10}), kTolerancePx), 100.0);
}

TEST(UnshownHoles, NarrowOnesCannotBeTold) {
  EXPECT_EQ(unshownHoles(plateWith({30, 40, 60, 4}), plate(), kTolerancePx), 0.0);
  EXPECT_GT(unshownHoles(plateWith({30, 40, 60, 5}), plate(), kTolerancePx), 0.0);
}

TEST(UnshownHoles, ABayIsNone) {
  EXPECT_EQ(unshownHoles(plateWith({40, 0, 20, 50}), plate(), kTolerancePx), 0.0);
}

}  // namespace
}  // namespace calipso::align
