#include "texture/texture_miss.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kPlace(0.0, 0.1, 0.12);
constexpr int kViews = 9;

Light evenLight() {
  Light light;
  light.ambient[0] = {0.8f, 0.8f, 0.8f};
  return light;
}

constexpr float kFine = 200.0f, kCoarse = 40.0f;  // rad/m: waves seven pixels long, and 35

// Waves over the ball, of its own axes.
cv::Vec3f patternAt(const Eigen::Vector3f& x, float waves) {
  return cv::Vec3f::all(0.35f + 0.2f * std::sin(waves * x.x()) * std::sin(waves * x.z()));
}

// The ball turned a little from view to view.
// @param off m by which the pictures' patterns are beside their poses, to either side in turn; then
//   half of the ball is plain
std::vector<View> patternedViews(const Surface& surface, float waves, float noise,
                                 float off = 0.0f) {
  std::vector<View> views;
  cv::RNG random(5);
  for (int i = 0; i < kViews; ++i) {
    View view{cv::Mat::zeros(kHeight, kWidth, CV_32FC3),
              cv::Mat::zeros(kHeight, kWidth, CV_8U),
              camera(),
              {}};
    Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
    turn.translate(kPlace).rotate(
        Eigen::AngleAxisd(0.07 * i, Eigen::Vector3d(0.2, 0.3, 1.0).normalized()));
    view.actors.push_back(
        makeActor(surface, transformed(surface.object_vertices, turn), view.camera));
    forEachPixelOf(view.actors.front(), [&](int u, int v, const SurfacePoint& p) {
      const cv::Vec3f shade = diffuseShading(evenLight(), p.normal, 1.0f, p.seen, {});
      Eigen::Vector3f own = (turn.inverse() * p.position.cast<double>()).cast<float>();
      own.x() += i % 2 == 0 ? off : -off;
      const bool plain = off > 0.0f && own.z() < 0.0f;
      const cv::Vec3f albedo = plain ? cv::Vec3f::all(0.35f) : patternAt(own, waves);
      for (int c = 0; c < 3; ++c)
        view.picture.at<cv::Vec3f>(v, u)[c] =
            codeFromLinear(albedo[c] * shade[c]) + static_cast<float>(random.gaussian(noise));
      view.labels.at<std::uint8_t>(v, u) = kBallLabel;
    });
    views.push_back(std::move(view));
  }
  return views;
}

// Drawn where a picture shows it, the texture has the picture's contrast, though it is a mean of
// pictures that lie between its texels.
TEST(TextureMiss, TheTextureIsAsSharpAsItsPictures) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const std::vector<View> views = patternedViews(surface, kFine, 0.0f);
  const Appearance a = makeAppearances(views, {true}, evenLight(), {Gloss()}).front();
  double product = 0.0, square = 0.0;
  for (int i = 2; i < kViews; ++i) {
    const Actor& actor = views[i].actors.front();
    const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
    forEachPixelOf(actor, [&](int, int, const SurfacePoint& p) {
      if (p.normal.dot((eye - p.position).normalized()) < 0.7f) return;
      const Eigen::Vector3i& t = surface.triangles[p.triangle];
      const Points& x = surface.object_vertices;
      const Eigen::Vector3f own =
          p.weights[0] * x[t[0]] + p.weights[1] * x[t[1]] + p.weights[2] * x[t[2]];
      const double truth = patternAt(own, kFine)[1] - 0.35,
                   drawn = a.texture.at(p.triangle, p.weights)[1] - 0.33;
      product += truth * drawn, square += truth * truth;
    });
  }
  // The light's floor takes 5 % off, the mean alone another 9.
  EXPECT_GT(product / square, 0.90);
  EXPECT_LT(product / square, 1.0);
}

// At the key frame the ball lies in the shade of something beside the picture, later it does not:
// nothing turns black, neither where it is seen nor where the key frame's colours are copied to.
TEST(TextureMiss, ShadeOfTheKeyFrameAloneIsNotProjectedBack) {
  const Surface surface = makeSurface(ballAt(kPlace));
  std::vector<View> views = patternedViews(surface, kCoarse, 0.0f);
  views[0].picture.forEach<cv::Vec3f>([](cv::Vec3f& code, const int*) {
    for (int c = 0; c < 3; ++c) code[c] = codeFromLinear(0.25f * linearFromRealCode(code[c]));
  });
  const Appearance a = makeAppearances(views, {true}, evenLight(), {Gloss()}).front();
  std::size_t dark = 0;
  for (const cv::Vec4f& texel : a.texture.texels) dark += texel[1] < 0.05f;
  EXPECT_LT(dark, a.texture.texels.size() / 1000);
}

// Where the further frames' pattern lies beside the key frame's, the key frame misses much of it. What
// no frame shows takes the key frame's colours, not these with that added.
TEST(TextureMiss, WhatIsMissedIsNotCopiedToUnseenSides) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const std::vector<View> views = patternedViews(surface, kCoarse, 0.0f, 0.01f);
  const Appearance a = makeAppearances(views, {true}, evenLight(), {Gloss()}).front();
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  const Points& x = surface.key_vertices;
  int texels = 0, too_much = 0;
  for (int t = 0; t < a.texture.triangleCount(); ++t) {
    const Eigen::Vector3i& c = surface.triangles[t];
    const Eigen::Vector3f at = (x[c[0]] + x[c[1]] + x[c[2]]) / 3.0f,
                          arm = at - kPlace.cast<float>();
    if (arm.normalized().dot((eye - at).normalized()) > -0.6f) continue;
    for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i)
      ++texels, too_much += std::abs(a.texture.texels[i][1] - 0.34f) > 0.22f;
  }
  ASSERT_GT(texels, 1000);
  EXPECT_LT(too_much, texels / 100);
}

TEST(TextureMiss, GrainIsWhatPixelsDeviateByThemselves) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const auto grain = [&](float noise) {
    return makeAppearances(patternedViews(surface, kCoarse, noise), {true}, evenLight(), {Gloss()})
        .front()
        .grain;
  };
  EXPECT_LT(grain(0.0f), 0.5f);
  // A mean of nine takes a share of each picture's noise along, and is sharpened.
  const float found = grain(3.0f);
  EXPECT_GT(found, 2.2f);
  EXPECT_LT(found, 3.3f);
}

TEST(TextureMiss, MarksBesideTheirPlaceAreNoGrain) {
  const Surface surface = makeSurface(ballAt(kPlace));
  // Waves seven pixels long, a pixel beside their place.
  const std::vector<View> views = patternedViews(surface, kFine, 0.0f, 0.0045f);
  EXPECT_LT(makeAppearances(views, {true}, evenLight(), {Gloss()}).front().grain, 0.5f);
}

// From one picture nothing can be told.
TEST(TextureMiss, OfOnePictureThereIsNoGrain) {
  const Surface surface = makeSurface(ballAt(kPlace));
  const std::vector<View> views = patternedViews(surface, kCoarse, 3.0f);
  EXPECT_EQ(makeAppearances({views[0]}, {true}, evenLight(), {Gloss()}).front().grain, 0.0f);
}

}  // namespace
}  // namespace calipso::render
