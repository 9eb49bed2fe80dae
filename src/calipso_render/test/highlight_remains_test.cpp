#include "texture/highlight_remains.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/appearance.hpp"
#include "calipso_render/colour.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const cv::Vec3f kPeel(0.03f, 0.12f, 0.25f);
constexpr int kSide = 80;
const cv::Point kMiddle(40, 40);

// A surface under a round lobe, half of which hides it.
struct Lit {
  cv::Mat albedo = cv::Mat(kSide, kSide, CV_32FC3, cv::Scalar(kPeel));
  cv::Mat trust = cv::Mat::ones(kSide, kSide, CV_32F);
  cv::Mat lobe = cv::Mat::zeros(kSide, kSide, CV_32F), clear = cv::Mat::ones(kSide, kSide, CV_32F);

  // @param across times as wide along the picture's rows as along its columns
  explicit Lit(float across = 1.0f) {
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kSide; ++u) {
        const float x = (u - kMiddle.x) / across, y = v - kMiddle.y;
        lobe.at<float>(v, u) = 0.9f * std::exp(-(x * x + y * y) / 50.0f);
        if (lobe.at<float>(v, u) > 0.5f) clear.at<float>(v, u) = 0.02f;
      }
    }
  }
  // How far a spot beside the middle counts.
  float clearAt(const cv::Point& spot, const cv::Vec3f& colour) {
    cv::circle(albedo, spot, 1, cv::Scalar(colour), cv::FILLED);
    cv::Mat after = clear.clone();
    hideRemains(albedo, trust, lobe, after);
    return after.at<float>(spot);
  }
};

constexpr float kBright = 0.3f;
const cv::Point kBesideMiddle(48, 40), kFarther(64, 40);

TEST(HighlightRemains, BrightSpotsAroundAHighlightAreHidden) {
  EXPECT_LT(Lit().clearAt(kBesideMiddle, kPeel + cv::Vec3f::all(kBright)), 0.1f);
  EXPECT_EQ(Lit().clearAt(kFarther, kPeel + cv::Vec3f::all(kBright)), 1.0f);
}

TEST(HighlightRemains, MarksOfAnotherColourStay) {
  EXPECT_EQ(Lit().clearAt(kBesideMiddle, kPeel + cv::Vec3f(0.0f, 0.1f, kBright)), 1.0f);
  EXPECT_EQ(Lit().clearAt(kBesideMiddle, 0.3f * kPeel), 1.0f);
}

// White stripes go on through a highlight.
TEST(HighlightRemains, WhatIsSeenBesideAHighlightAsWellStays) {
  Lit striped;
  const cv::Vec3f white = kPeel + cv::Vec3f::all(kBright);
  for (int u = 4; u < kSide; u += 8) striped.albedo.colRange(u, u + 3).setTo(cv::Scalar(white));
  EXPECT_EQ(striped.clearAt({46, 46}, white), 1.0f);
}

TEST(HighlightRemains, AlongAnEdgeNothingIsSpread) {
  EXPECT_EQ(Lit(6.0f).clearAt({40, 48}, kPeel + cv::Vec3f::all(kBright)), 1.0f);
}

// A ball of peel, whose highlight is broken up into spots, has no white ones where it is turned.
TEST(HighlightRemains, AreNotInTheTexture) {
  const Eigen::Vector3d place(0.0, 0.1, 0.12);
  const Surface surface = makeSurface(ballAt(place));
  constexpr Gloss kTold{0.03f, 0.15f, 0.0f}, kSpread{0.12f, 0.25f, 0.0f};
  View view{cv::Mat::zeros(kHeight, kWidth, CV_32FC3),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {makeActor(surface, surface.key_vertices, camera())}};
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  forEachPixelOf(view.actors.front(), [&](int u, int v, const SurfacePoint& p) {
    const cv::Vec3f diffuse = diffuseShading(sunlight(), p.normal, 1.0f, p.seen, {}),
                    highlight = specularShading(sunlight(), kSpread, p.normal,
                                                (eye - p.position).normalized(), 1.0f, 1.0f);
    const float spot = (u / 2 + v / 2) % 2 == 0 ? 1.5f : 0.5f;
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] =
          std::min(255.0f, codeFromLinear(kPeel[c] * diffuse[c] + spot * highlight[c]));
    view.labels.at<std::uint8_t>(v, u) = kBallLabel;
  });
  const Appearance a = makeAppearances({view}, {false}, sunlight(), {kTold}).front();
  cv::Mat inside;
  cv::erode(view.labels == kBallLabel, inside, cv::Mat::ones(9, 9, CV_8U));
  cv::Mat blue;
  cv::extractChannel(a.albedo, blue, 0);
  double most = 0.0;
  cv::minMaxLoc(blue, nullptr, &most, nullptr, nullptr, inside(a.region));
  EXPECT_LT(most, 0.16);  // 0.25 if they were taken for its colour
}

}  // namespace
}  // namespace calipso::render
