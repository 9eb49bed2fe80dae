#include "calipso_bag/shot_changes.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace calipso::bag {
namespace {

const cv::Size kSize(160, 90);

// A place of random large patches with sensor noise, a disc somewhere before it, in some light.
cv::Mat picture(int place, int frame, double light = 1.0) {
  cv::RNG patches(place), noise(1000 + frame);
  cv::Mat small(6, 8, CV_8UC3), image, grain(kSize, CV_16SC3);
  patches.fill(small, cv::RNG::UNIFORM, 20, 150);
  cv::resize(small, image, kSize, 0, 0, cv::INTER_CUBIC);
  cv::circle(image, cv::Point(15 + 12 * frame, 40), 14, cv::Scalar(20, 30, 200), cv::FILLED);
  noise.fill(grain, cv::RNG::NORMAL, 0.0, 3.0);
  image.convertTo(image, CV_16SC3, light);
  image += grain;
  image.convertTo(image, CV_8UC3);
  return image;
}

TEST(ShotChanges, FindsTheFrameWithWhichAnotherShotBegins) {
  ShotChanges changes;
  for (int k = 0; k < 12; ++k) changes.add(picture(k < 5 ? 1 : k < 9 ? 2 : 3, k));
  EXPECT_EQ(changes.found(), (std::vector<int>{5, 9}));
}

TEST(ShotChanges, NeitherMotionNorLightIsOne) {
  ShotChanges changes;
  for (int k = 0; k < 12; ++k) changes.add(picture(1, k, k < 6 ? 0.5 : 1.5));
  EXPECT_TRUE(changes.found().empty());
}

TEST(ShotChanges, AFlashIsNone) {
  ShotChanges changes;
  for (int k = 0; k < 12; ++k)
    changes.add(k == 6 ? cv::Mat(kSize, CV_8UC3, cv::Scalar::all(255)) : picture(1, k));
  EXPECT_TRUE(changes.found().empty());
}

TEST(ShotChanges, AClipThatShowsNothingHasNone) {
  ShotChanges changes;
  for (int k = 0; k < 5; ++k) changes.add(cv::Mat(kSize, CV_8U, cv::Scalar(10)));
  EXPECT_TRUE(changes.found().empty());
}

}  // namespace
}  // namespace calipso::bag
