#include "prepare_background.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/clip_sample.hpp"
#include "calipso_render/renderer.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A post before the ball and before the table on which the ball's shadow falls.
TEST(PrepareBackground, WhatStandsBeforeAShadowKeepsItsPixels) {
  const ObjectModel model = ballAt({0.0, 0.1, kBallRadius});
  ClipFrame frame = frameWithBall(model);
  RenderParams params;
  params.planes = table();
  params.depth = cv::Mat(kHeight, kWidth, CV_32F);
  const Eigen::Isometry3d from_world = camera().world_from_camera.inverse();
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = receiverAt(table(), camera(), u, v);
      const Eigen::Vector3d seen = frame.labels.at<std::uint8_t>(v, u) != 0 || !r
                                       ? model.world_from_object.translation()
                                       : Eigen::Vector3d(r->position.cast<double>());
      params.depth.at<float>(v, u) = static_cast<float>((from_world * seen).z());
    }
  }
  const cv::Rect post(70, 20, 23, kHeight - 20);
  frame.bgr(post).setTo(cv::Scalar(20, 20, 200));
  frame.labels(post).setTo(0);
  params.depth(post).setTo(0.3f);
  ClipSample clip;
  clip.add(frame);
  const cv::Mat invented = prepare(clip, {model}, params).background.invented;
  const cv::Rect core(post.x + 4, post.y, post.width - 8, post.height);  // without its rim
  EXPECT_EQ(cv::countNonZero(invented(core)), 0);
  EXPECT_GT(cv::countNonZero(invented), kHeight);  // the ball, on both sides
}

// The ball over the table, or ground that is not plane, as the depth image has it, in sunlight.
struct BallOverGround {
  const ObjectModel model = ballAt({0.0, 0.1, 0.2});
  const Surface surface = makeSurface(model);
  ClipFrame frame = frameWithBall(model);
  RenderParams params;
  cv::Mat shaded = cv::Mat::zeros(kHeight, kWidth, CV_8U);  // 255: the sun is hidden there
  ShadowMap sun{{{&surface.key_vertices, &surface.triangles}},
                sunlight().direction.cast<double>(),
                {512, 0.025, 16}};

  explicit BallOverGround(float bumps) {
    params.planes = table();
    frame.bgr.setTo(cv::Scalar::all(150), frame.labels == 0);
    params.depth = cv::Mat(kHeight, kWidth, CV_32F);
    const Eigen::Isometry3d from_world = camera().world_from_camera.inverse();
    const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const bool ball = frame.labels.at<std::uint8_t>(v, u) != 0;
        Receiver seen = *receiverAt(table(), camera(), u, v);
        seen.position +=
            bumps * (5.0f + 3.0f * std::sin(1.3f * u) * std::sin(1.1f * v)) * (eye - seen.position);
        if (ball) seen.position = model.world_from_object.translation().cast<float>();
        params.depth.at<float>(v, u) =
            static_cast<float>((from_world * seen.position.cast<double>()).z());
        if (ball || sun.visibility(seen.position, seen.normal) > 0.5f) continue;
        shaded.at<std::uint8_t>(v, u) = 255;
        frame.bgr.at<cv::Vec3b>(v, u) *= 0.6;
      }
    }
  }

  // Something without a model, nearer than all else.
  void stand(const cv::Rect& where) {
    frame.bgr(where).setTo(cv::Scalar(20, 160, 60));
    frame.labels(where).setTo(0);
    params.depth(where).setTo(0.3f);
  }

  // @param confirmed by something besides shading
  Prepared prepared(bool confirmed, const Visibility& sky) const {
    ClipSample clip;
    clip.add(frame);
    Prepared p = prepare(clip, {model}, params);
    p.light = LightFit();
    p.light.light = sunlight();
    p.light.determined = true, p.light.from_shadows = confirmed;
    const std::vector<Actor> actors = {makeActor(surface, surface.key_vertices, frame.camera)};
    cv::Mat picture;
    frame.bgr.convertTo(picture, CV_32F);
    const std::vector<ClipFrame> frames = {frame};
    const Background seen = seenBackground(frames, false);
    prepareBackground({frames, {}, actors, seen, picture, sun, sky, sun, sky, false}, params, p);
    return p;
  }
};

TEST(PrepareBackground, CurvedPlacesGiveUpTheShadowsOfAConfirmedLightAlone) {
  const BallOverGround place(0.01f);
  const ShadowMap sky({}, Eigen::Vector3d::UnitZ(), {});
  const auto invented = [&](bool confirmed) {
    return cv::countNonZero(place.prepared(confirmed, sky).background.invented & place.shaded);
  };
  const double shaded = cv::countNonZero(place.shaded);
  ASSERT_GT(shaded, 300);
  EXPECT_GT(invented(true), 0.95 * shaded);
  EXPECT_LT(invented(false), 0.5 * shaded);  // ... but what the rim of the ball covers
}

// Spots all over the table that no sky reaches, as is predicted; the picture has none.
class SpotsWithoutSky : public Visibility {
 public:
  explicit SpotsWithoutSky(float radius) : radius_(radius) {}
  float visibility(const Eigen::Vector3f& at, const Eigen::Vector3f&) const override {
    const auto off = [&](float x) { return x - 5.0f * radius_ * std::round(x / (5.0f * radius_)); };
    return std::hypot(off(at.x()), off(at.y())) < radius_ ? 0.0f : 1.0f;
  }
  bool empty() const override { return false; }
  std::optional<float> uniform(const Eigen::Vector3f&, const Eigen::Vector3f&,
                               float) const override {
    return std::nullopt;
  }

 private:
  float radius_;  // m
};

TEST(PrepareBackground, WhereTheSunIsHiddenASkyThatIsNotChangesNothing) {
  const BallOverGround place(0.0f);
  const Prepared p = place.prepared(true, SpotsWithoutSky(0.06f));
  EXPECT_GT(cv::countNonZero(p.shadowless), 100);
  EXPECT_EQ(cv::countNonZero(p.shadowless & place.shaded), 0);
}

TEST(PrepareBackground, SpecksWithoutSkyKeepNoShadowOff) {
  const BallOverGround place(0.0f);
  EXPECT_EQ(cv::countNonZero(place.prepared(true, SpotsWithoutSky(0.02f)).shadowless), 0);
}

const ShadowMap kOpenSky({}, Eigen::Vector3d::UnitZ(), {});

// They would become a dark line around it, or a lit one where its own surface is in shade.
TEST(PrepareBackground, OutermostPixelsOfWhatStandsOnAPlaneTakeNoShadowOfThePlane) {
  BallOverGround place(0.0f);
  const cv::Rect post(10, 20, 12, 60);
  place.stand(post);
  const Prepared p = place.prepared(true, kOpenSky);
  EXPECT_EQ(cv::countNonZero((p.shadowless | p.relief.seen)(post)), post.area());
  EXPECT_EQ(cv::countNonZero(p.relief.seen(post)), post.area());
  cv::Mat elsewhere = p.shadowless | p.relief.seen;
  elsewhere(post).setTo(0);
  EXPECT_EQ(cv::countNonZero(elsewhere), 0);
}

// Blades of grass before an object's foot: the ground between them is not seen there.
TEST(PrepareBackground, BetweenBladesBeforeAFootNoShadowLies) {
  BallOverGround place(0.0f);
  const cv::Rect ball = cv::boundingRect(place.frame.labels);
  const cv::Rect before(ball.x + 10, ball.br().y, ball.width - 20, 12);
  for (int u = before.x; u < before.br().x; u += 5) place.stand({u, before.y - 4, 2, 16});
  const cv::Mat shadowless = place.prepared(true, kOpenSky).shadowless;
  EXPECT_EQ(cv::countNonZero(shadowless(before)), before.area());
  EXPECT_LT(cv::countNonZero(shadowless), kWidth * kHeight / 4);
}

}  // namespace
}  // namespace calipso::render
