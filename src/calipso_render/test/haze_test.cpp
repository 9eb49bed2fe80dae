#include "place/haze.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 200, kHigh = 160, kHorizon = 40;  // px
constexpr float kNear = 100.0f, kFar = 1600.0f;         // m
const cv::Vec3f kAir(0.8f, 0.7f, 0.6f);

// Ground from kNear to kFar below a sky, a tenth of it dark, through air.
struct Land {
  cv::Mat picture = cv::Mat(kHigh, kWide, CV_32FC3),
          nearness = cv::Mat::zeros(kHigh, kWide, CV_32F),
          sky = cv::Mat::zeros(kHigh, kWide, CV_8U);

  Land(float extinction, float darkest, float bright = 0.3f) {
    for (int v = 0; v < kHigh; ++v) {
      for (int u = 0; u < kWide; ++u) {
        cv::Vec3f linear = kAir;
        if (v < kHorizon) {
          sky.at<std::uint8_t>(v, u) = 255;
        } else {
          const float part = static_cast<float>(kHigh - 1 - v) / (kHigh - 1 - kHorizon),
                      distance = kNear * std::pow(kFar / kNear, part);
          const float left = std::exp(-extinction * distance), own = u % 10 == 0 ? darkest : bright;
          nearness.at<float>(v, u) = 1.0f / distance;
          linear = left * cv::Vec3f::all(own) + (1.0f - left) * kAir;
        }
        for (int c = 0; c < 3; ++c) picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(linear[c]);
      }
    }
  }
  Haze haze() const { return Haze(picture, nearness, sky); }
};

TEST(Haze, IsToldByWhatIsDarkest) {
  const Land land(5e-4f, 0.004f);
  const Haze haze = land.haze();
  ASSERT_TRUE(haze.established());
  for (const float distance : {200.0f, 600.0f, 1200.0f}) {
    const cv::Vec3f added = haze.addedAt(1.0f / distance);
    // What is darkest is not quite black, and distances are told to an eighth.
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(added[c] / (kAir[c] * (1.0f - std::exp(-5e-4f * distance))), 1.0, 0.15);
  }
  const cv::Mat clear = withoutHaze(haze, land.picture, land.nearness);
  EXPECT_NEAR(linearFromRealCode(clear.at<cv::Vec3f>(80, 5)[1]) /
                  std::exp(-5e-4f / land.nearness.at<float>(80, 5)),
              0.3, 0.03);
  const cv::Mat veil = veilOf(haze, linearFromRealCodes(land.picture), land.nearness);
  EXPECT_GT(veil.at<std::uint8_t>(kHorizon + 2, 5), 140);  // 0.55 of 0.66 times the air's
  EXPECT_LT(veil.at<std::uint8_t>(kHigh - 2, 5), 30);
}

TEST(Haze, IsNoneWhereFarThingsAreAsDarkAsNearOnes) {
  EXPECT_FALSE(Land(0.0f, 0.02f).haze().established());
  // snow below a darker sky: no haze makes anything brighter than itself
  EXPECT_FALSE(Land(0.0f, 0.85f, 0.95f).haze().established());
  EXPECT_TRUE(veilOf(Haze(), cv::Mat(), cv::Mat()).empty());
}

}  // namespace
}  // namespace calipso::render
