#include "frame/place_light.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_stages.hpp"
#include "frame/occlusion.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// of the ball's radius: within the shadow's core, and beyond its soft edge. The sun's disc adds
// 0.025 rad over some 0.2 m to either side, a map's texel some mm.
constexpr double kCore = 0.85, kBeyond = 1.2;

TEST(ShadowBounds, HoldAllOfTheShadow) {
  const BallStages s(Eigen::Vector3f::Zero());
  const cv::Rect bounds = shadowBounds(s.frame, s.place.view.relief(),
                                       s.prepared->surfaces[0].key_vertices, sunlight().direction);
  int shaded = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (passesBy(u, v, kCentre).value_or(9.0) >= 1.0) continue;
      ASSERT_TRUE(bounds.contains({u, v})) << u << ", " << v;
      ++shaded;
    }
  }
  EXPECT_GT(shaded, 100);
  EXPECT_LT(bounds.area(), 10 * shaded);
}

// Whether all corners of a pixel lie beyond the soft edge: a pixel has the mean of what they see.
bool passesBeyond(int u, int v, const Eigen::Vector3d& centre) {
  for (const int k : {0, 1, 2, 3}) {
    if (passesBy(u - 0.5f + (k & 1), v - 0.5f + (k >> 1), centre).value_or(9.0) <= kBeyond)
      return false;
  }
  return true;
}

TEST(RestingLight, HasTheShadowOfTheOriginal) {
  const BallStages s({0.25f, 0.0f, 0.0f});
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const double passes = passesBy(u, v, kCentre).value_or(9.0);
      const int sun = s.resting.sunBefore().at<std::uint8_t>(v, u);
      if (passes < kCore) {
        ASSERT_LT(sun, 20) << u << ", " << v;
        ASSERT_EQ(s.resting.shaded().at<std::uint8_t>(v, u), 255) << u << ", " << v;
      } else if (passesBeyond(u, v, kCentre)) {
        ASSERT_EQ(sun, 255) << u << ", " << v;
      }
    }
  }
}

// What a renderer has drawn before does not matter: neither another sun nor another object moved.
TEST(RestingLight, IsThatOfTheFrameWhateverWasBefore) {
  const BallStages s({0.25f, 0.0f, 0.0f});
  FrameInput other = s.input, unedited = s.input;
  other.sun.direction = Eigen::Vector3f(-0.5f, 0.2f, 0.8f);
  unedited.objects[0].edited = false;
  RestingLight light;
  for (const FrameInput& input : {other, unedited, s.input}) {
    const StagedFrame frame(*s.prepared, s.render, input);
    light.update(frame, SeenPlace(frame));
  }
  EXPECT_EQ(cv::norm(light.sunBefore(), s.resting.sunBefore(), cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(light.skyBefore(), s.resting.skyBefore(), cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(light.shaded(), s.resting.shaded(), cv::NORM_INF), 0.0);
  EXPECT_EQ(light.bounds(), s.resting.bounds());
}

TEST(PlaceLight, TheShadowGoesAlong) {
  const Eigen::Vector3f move(-0.3f, 0.0f, 0.0f);
  const BallStages s(move);
  const PlaceLight light(s.frame, s.place, s.resting, s.moved, s.region, s.surfaces.covered());
  int dark = 0, lit = 0;
  for (int v = s.region.all.y; v < s.region.all.br().y; ++v) {
    for (int u = s.region.all.x; u < s.region.all.br().x; ++u) {
      if (s.surfaces.covered().at(u, v)) continue;
      const double before = passesBy(u, v, kCentre).value_or(9.0),
                   now = passesBy(u, v, kCentre + move.cast<double>()).value_or(9.0);
      const cv::Point at = cv::Point(u, v) - s.region.all.tl();
      if (now < kCore) {
        ASSERT_TRUE(light.relightable().at(u, v)) << u << ", " << v;
        ASSERT_LT(light.sun().at<std::uint8_t>(at), 20) << u << ", " << v;
        ++dark;
      } else if (now > kBeyond && before < kCore) {
        ASSERT_TRUE(light.relightable().at(u, v)) << u << ", " << v;
        ASSERT_EQ(light.sun().at<std::uint8_t>(at), 255) << u << ", " << v;
        // what the sun newly reaches comes from the plate
        ASSERT_EQ(light.relit().at<std::uint8_t>(at), 255) << u << ", " << v;
        ++lit;
      }
    }
  }
  EXPECT_GT(dark, 100);
  EXPECT_GT(lit, 100);
}

// The shadow's core around `centre`, CV_8UC1.
cv::Mat coreAround(const Eigen::Vector3d& centre) {
  cv::Mat core = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u)
      if (passesBy(u, v, centre).value_or(9.0) < kCore) core.at<std::uint8_t>(v, u) = 255;
  return core;
}

// Where a shadow moves a little its middle stays the video's, which tells how dark it is; its edges
// come from the plate.
TEST(PlaceLight, DeepShadeThatStaysIsTheVideos) {
  const Eigen::Vector3f move(-0.04f, 0.0f, 0.0f);
  RenderParams narrow = params();  // the shadow is small
  narrow.background.shadow_margin_px = 2;
  const BallStages s(move, narrow);
  const PlaceLight light(s.frame, s.place, s.resting, s.moved, s.region, s.surfaces.covered());
  const int reach = narrow.background.shadow_margin_px + 2;
  const cv::Mat before = coreAround(kCentre), now = coreAround(kCentre + move.cast<double>());
  cv::Mat deep, edge;
  cv::erode(before, deep, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  cv::erode(before, edge, cv::Mat::ones(3, 3, CV_8U));
  edge = before & ~edge & now, deep &= now;
  cv::Mat relit = cv::Mat::zeros(before.size(), CV_8U);
  light.relit().copyTo(relit(s.region.all));
  ASSERT_GT(cv::countNonZero(deep), 20);
  EXPECT_EQ(cv::countNonZero(relit & deep), 0);
  EXPECT_GT(cv::countNonZero(relit & edge), cv::countNonZero(edge) / 4);
}

}  // namespace
}  // namespace calipso::render
