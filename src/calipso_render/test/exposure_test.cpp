#include "place/exposure.hpp"

#include <gtest/gtest.h>

#include "ball_setting.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const cv::Vec3f kDimmed(0.78f, 0.8f, 0.85f);

TEST(Exposure, IsToldByWhatMostOfThePlaceHasInCommon) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  const ExposureMeter meter(key.bgr, key.labels);
  EXPECT_FALSE(meter.gainOf(key.bgr, key.labels));
  const auto gain = meter.gainOf(exposedBy(key.bgr, kDimmed), key.labels);
  ASSERT_TRUE(gain);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR((*gain)[c], kDimmed[c], 0.01f);
}

TEST(Exposure, IsNotWhatNoiseOrAShadowMakes) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  const ExposureMeter meter(key.bgr, key.labels);
  cv::Mat noise(key.bgr.size(), CV_16SC3), noisy;
  cv::RNG random(5);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 3.0);
  cv::add(key.bgr, noise, noisy, cv::noArray(), CV_8U);
  EXPECT_FALSE(meter.gainOf(noisy, key.labels));
  cv::Mat half_shaded = key.bgr.clone();
  exposedBy(key.bgr, kDimmed).colRange(0, kWidth / 2).copyTo(half_shaded.colRange(0, kWidth / 2));
  EXPECT_FALSE(meter.gainOf(half_shaded, key.labels));
}

TEST(Exposure, OfAClipIsThatOfItsFirstFrame) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  ClipSample clip;
  for (int k = 0; k < 4; ++k) {
    ClipFrame frame = key;
    if (k > 1) frame.bgr = exposedBy(key.bgr, kDimmed);
    clip.add(frame);
  }
  const auto even = evenlyExposed(clip);
  ASSERT_TRUE(even);
  for (const ClipFrame& frame : even->frames())
    EXPECT_LE(cv::norm(frame.bgr, key.bgr, cv::NORM_INF), 2.0);
  ClipSample same;
  same.add(key), same.add(key);
  EXPECT_FALSE(evenlyExposed(same));
}

// What comes to light, and what is drawn, is as bright as the frame at hand.
TEST(Exposure, OfAFrameIsThatOfWhatIsDrawnInIt) {
  const Setting s(params());
  Renderer renderer(s.prepared, params());
  FrameInput in = s.input(true, {0.15f, 0.0f, 0.0f});
  const cv::Mat expected = exposedBy(renderer.composite(in).bgr, kDimmed);
  in.bgr = exposedBy(s.key.bgr, kDimmed);
  const FrameOutput dimmed = renderer.composite(in);
  EXPECT_LE(cv::norm(dimmed.bgr, expected, cv::NORM_INF), 3.0);
  cv::Mat kept = dimmed.bgr.clone();
  in.bgr.copyTo(kept, dimmed.provenance == kOriginal);
  EXPECT_EQ(cv::norm(kept, dimmed.bgr, cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace calipso::render
