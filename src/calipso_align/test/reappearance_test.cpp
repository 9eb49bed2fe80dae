#include "../src/reappearance.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using testing::disc;
using testing::intersectionOverUnion;
using testing::maskOf;
using testing::paint;

const cv::Size kSize(160, 120);
const cv::Vec3b kRed(40, 50, 200), kBlue(200, 80, 40), kWall(150, 160, 150);
constexpr double kNoise = 2.0;  // grey levels
constexpr int kLeast = 50;      // px

const cv::Mat kNothing = cv::Mat::zeros(kSize, CV_8U);
const testing::SignedDistance kNowhere = [](double, double) { return 1e3; };

KnownBackground wall() {
  return {paint(kSize, kNowhere, kRed, kWall, kNoise), cv::Mat(kSize, CV_8U, cv::Scalar(255))};
}

GaussianMixture red() {
  cv::RNG rng(3);
  std::vector<cv::Vec3f> samples;
  for (int k = 0; k < 300; ++k)
    samples.emplace_back(kRed[0] + static_cast<float>(rng.gaussian(kNoise)),
                         kRed[1] + static_cast<float>(rng.gaussian(kNoise)),
                         kRed[2] + static_cast<float>(rng.gaussian(kNoise)));
  return GaussianMixture::fit(samples, 2);
}

TEST(Reappearance, FindsTheObjectWhereverItIs) {
  for (const double u : {30.0, 120.0, 158.0}) {  // the last one comes in at the border
    const cv::Mat image = paint(kSize, disc(u, 50, 15), kRed, kWall, kNoise);
    const cv::Mat found = findAgain(image, wall(), kNothing, red(), kLeast).mask;
    ASSERT_FALSE(found.empty()) << u;
    EXPECT_GE(intersectionOverUnion(found, maskOf(kSize, disc(u, 50, 15))), 0.9) << u;
  }
}

TEST(Reappearance, NothingIsFoundWhereNothingHasCome) {
  const cv::Mat image = paint(kSize, kNowhere, kRed, kWall, kNoise);
  EXPECT_TRUE(findAgain(image, wall(), kNothing, red(), kLeast).mask.empty());
}

TEST(Reappearance, SomethingElseIsNotTakenForTheObject) {
  const cv::Mat image = paint(kSize, disc(60, 50, 20), kBlue, kWall, kNoise);
  EXPECT_TRUE(findAgain(image, wall(), kNothing, red(), kLeast).mask.empty());
  const cv::Mat both = paint(kSize, disc(120, 50, 12), kRed, kWall, kNoise, image);
  EXPECT_GE(intersectionOverUnion(findAgain(both, wall(), kNothing, red(), kLeast).mask,
                                  maskOf(kSize, disc(120, 50, 12))),
            0.9);
}

TEST(Reappearance, AnotherObjectKeepsWhatIsIts) {
  const cv::Mat image = paint(kSize, disc(60, 50, 15), kRed, kWall, kNoise);
  const cv::Mat taken = maskOf(kSize, disc(60, 50, 17));
  EXPECT_TRUE(findAgain(image, wall(), taken, red(), kLeast).mask.empty());
}

TEST(Reappearance, ABackgroundThatMovesTellsNothing) {
  const auto stripes = [](double shift) {
    cv::Mat image(kSize, CV_8UC3);
    for (int v = 0; v < kSize.height; ++v)
      for (int u = 0; u < kSize.width; ++u)
        image.at<cv::Vec3b>(v, u) =
            cv::Vec3b::all(cv::saturate_cast<uchar>(128 + 60 * std::sin(0.4 * (u + shift))));
    return image;
  };
  const KnownBackground before{stripes(0), cv::Mat(kSize, CV_8U, cv::Scalar(255))};
  const cv::Mat image = paint(kSize, disc(60, 50, 15), kRed, kWall, kNoise, stripes(4));
  EXPECT_TRUE(findAgain(image, before, kNothing, red(), kLeast).mask.empty());
}

}  // namespace
}  // namespace calipso::align
