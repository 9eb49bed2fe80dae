#include "calipso_render/unseen_shade.hpp"

#include <gtest/gtest.h>

#include "ball_setting.hpp"
#include "calipso_render/appearance.hpp"

namespace calipso::render {
namespace {

using namespace testing;

constexpr float kEdge = -0.1f;  // m: what comes down on the table left of it has no sun

std::optional<Receiver> tableAt(int u, int v) { return receiverAt(table(), camera(), u, v); }

// Where light that passes `p` comes down on the table.
Eigen::Vector3f landingOf(const Eigen::Vector3f& p) {
  const Eigen::Vector3f l = sunlight().direction;
  return p - p.z() / l.z() * l;
}

cv::Mat hiddenOnTable() {
  cv::Mat hidden = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = tableAt(u, v);
      if (r && r->position.x() < kEdge) hidden.at<std::uint8_t>(v, u) = 255;
    }
  }
  return hidden;
}

UnseenShade shadeOnTable() {
  return {hiddenOnTable(), cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255)), tableAt,
          sunlight().direction};
}

float sunAt(const UnseenShade& shade, const Eigen::Vector3f& p) {
  return shade.visibility(p, Eigen::Vector3f::UnitZ());
}

TEST(UnseenShade, KeepsTheSunOffAllThatIsBeforeAShadedPlace) {
  const UnseenShade shade = shadeOnTable();
  ASSERT_FALSE(shade.empty());
  const Eigen::Vector3f l = sunlight().direction, dark(kEdge - 0.05f, 0.1f, 0.0f),
                        lit(kEdge + 0.05f, 0.1f, 0.0f);
  for (const float along : {0.0f, 0.1f, 0.4f}) {
    EXPECT_EQ(sunAt(shade, dark + along * l), 0.0f);
    EXPECT_EQ(sunAt(shade, lit + along * l), 1.0f);
  }
}

TEST(UnseenShade, IsThatOfTheNearestPlaceWhereTheLightComesDownOutOfView) {
  const UnseenShade shade = shadeOnTable();
  EXPECT_EQ(sunAt(shade, {-9.0f, 0.3f, 0.0f}), 0.0f);
  EXPECT_EQ(sunAt(shade, {9.0f, 0.3f, 0.0f}), 1.0f);
}

TEST(UnseenShade, IsNoneWhereNothingIsKnown) {
  const cv::Mat none = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  const UnseenShade shade(hiddenOnTable(), none, tableAt, sunlight().direction);
  EXPECT_TRUE(shade.empty());
  EXPECT_EQ(sunAt(shade, {-0.3f, 0.1f, 0.0f}), 1.0f);
}

// A ball over the border of the shade, as the camera sees it.
ClipFrame frameInShade(const Eigen::Vector3d& centre) {
  ClipFrame frame = frameWithBall(ballAt(centre));
  const Surface surface = makeSurface(ballAt(centre));
  forEachPixelOf(makeActor(surface, surface.key_vertices, frame.camera),
                 [&](int u, int v, const SurfacePoint& p) {
                   if (landingOf(p.position).x() > kEdge) return;
                   const cv::Vec3f lit = diffuseShading(sunlight(), p.normal, 1.0f),
                                   dark = diffuseShading(sunlight(), p.normal, 0.0f);
                   cv::Vec3b& code = frame.bgr.at<cv::Vec3b>(v, u);
                   for (int c = 0; c < 3; ++c)
                     code[c] = quantise(codeFromLinear(linearFromCode(code[c]) * dark[c] / lit[c]));
                 });
  return frame;
}

View viewOf(const ClipFrame& frame, const Surface& surface) {
  View view{{}, frame.labels, frame.camera, {}};
  frame.bgr.convertTo(view.picture, CV_32F);
  view.actors.push_back(makeActor(surface, surface.key_vertices, frame.camera));
  return view;
}

// Nor is it the light's.
TEST(FitLight, IsNotDarkenedByShadeThatIsKnown) {
  const ClipFrame frame = frameInShade(kCentre);
  const Surface surface = makeSurface(ballAt(kCentre));
  const std::vector<View> views = {viewOf(frame, surface)};
  const UnseenShade shade = shadeOnTable();
  LightEvidence evidence = lightEvidence(views, {false}, table(), {}, {});
  evidence.known_sun = sunlight().direction;
  evidence.visible = [&, past = evidence.visible](const LightSample& s, const Eigen::Vector3f& l) {
    return past(s, l) * sunAt(shade, s.position);
  };
  const LightFit fit = fitLight(evidence, Eigen::Vector3f::UnitZ(), Eigen::Vector3f::UnitY());
  ASSERT_TRUE(fit.determined && fit.confirmed());
  EXPECT_GT(fit.light.direction.dot(sunlight().direction), 0.99999f);
  EXPECT_NEAR(fit.light.sun[1] / fit.light.ambient[0][1], 0.7f / 0.3f, 0.35f);
}

// The shade is not the object's own colour.
TEST(Appearance, IsNoDarkerInTheShadeOfWhatIsNotSeen) {
  const ClipFrame frame = frameInShade(kCentre);
  const Surface surface = makeSurface(ballAt(kCentre));
  const View view = viewOf(frame, surface);
  const UnseenShade shade = shadeOnTable();
  const Appearance a = makeAppearances({view}, {false}, sunlight(), {Gloss()}, {}, shade).front();
  int dark = 0;
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    // in the light, where the model's own shade is none, and beside the border
    if (p.normal.dot(sunlight().direction) < 0.3f || sunAt(shade, p.position) > 0.0f ||
        landingOf(p.position).x() > kEdge - 0.01f)
      return;
    ++dark;
    EXPECT_NEAR(a.albedo.at<cv::Vec4f>(v - a.region.y, u - a.region.x)[2], 0.6f, 0.09f);
  });
  EXPECT_GT(dark, 100);
}

TEST(Renderer, DrawsWhatHasMovedIntoTheShadeOfWhatIsNotSeenInIt) {
  const Setting s(params());
  auto shaded = std::make_shared<Prepared>(*s.prepared);
  shaded->unseen_shade =
      UnseenShade(hiddenOnTable(), cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255)), tableAt,
                  shaded->light.light.direction);
  const FrameInput moved = s.input(true, {-0.25f, 0.0f, 0.0f});
  const cv::Mat in_sun = Renderer(s.prepared, params()).composite(moved).bgr,
                in_shade = Renderer(shaded, params()).composite(moved).bgr;
  EXPECT_LT(cv::sum(in_shade)[2], cv::sum(in_sun)[2] - 2000.0);
  FrameInput evening = moved;  // another sun, which nothing is known to hide
  evening.sun.direction = Eigen::Vector3f(-0.5f, -0.3f, 0.8f).normalized();
  EXPECT_EQ(cv::norm(Renderer(s.prepared, params()).composite(evening).bgr,
                     Renderer(shaded, params()).composite(evening).bgr, cv::NORM_INF),
            0.0);
}

constexpr double kKeyX = 0.03;

// The ball flies across the border of the shade, in which its own leaves no trace.
ClipSample flightAcrossBorder() {
  const Eigen::Vector3f l = sunlight().direction;
  ClipSample clip;
  for (int i = 0; i < 16; ++i) {
    const Eigen::Vector3d centre(i == 0 ? kKeyX : -0.2 + 0.03 * i, 0.1, 0.2);
    ClipFrame f = frameInShade(centre);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto r = tableAt(u, v);
        if (f.labels.at<std::uint8_t>(v, u) != 0 || !r) continue;
        const Eigen::Vector3f way = centre.cast<float>() - r->position;
        const bool in_shadow = (way - way.dot(l) * l).norm() < kBallRadius;
        const bool dark = in_shadow || r->position.x() < kEdge;
        f.bgr.at<cv::Vec3b>(v, u) = (dark ? 0.55 : 1.0) * cv::Vec3d(120.0, 140.0, 160.0);
      }
    }
    ObjectPose pose{kBallLabel};
    pose.world_from_object.translation() = centre;
    f.poses = {pose}, f.stamp_ns = i;
    clip.add(f);
  }
  return clip;
}

cv::Mat depthOfTable() {
  cv::Mat depth = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  const Eigen::Isometry3d camera_from_world = camera().world_from_camera.inverse();
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (const auto r = tableAt(u, v))
        depth.at<float>(v, u) =
            static_cast<float>((camera_from_world * r->position.cast<double>()).z());
    }
  }
  return depth;
}

TEST(Prepare, LearnsAnObjectPastWhatKeepsTheSunOffIt) {
  RenderParams exact = params();
  exact.background.shadow_margin_px = 2;  // the ball's shadow is small
  exact.depth = depthOfTable();
  const Prepared p = prepare(flightAcrossBorder(), {ballAt({kKeyX, 0.1, 0.2})}, exact);
  ASSERT_TRUE(p.light.confirmed());
  ASSERT_FALSE(p.unseen_shade.empty());
  EXPECT_LT(sunAt(p.unseen_shade, {-0.2f, 0.1f, 0.1f}), 0.1f);
  EXPECT_GT(sunAt(p.unseen_shade, {0.2f, 0.1f, 0.1f}), 0.9f);
  const Actor ball = makeActor(p.surfaces[0], p.surfaces[0].key_vertices, camera());
  double dark = 0.0, lit = 0.0;
  int darks = 0, lits = 0;
  const Appearance& a = p.appearances[0];
  forEachPixelOf(ball, [&](int u, int v, const SurfacePoint& at) {
    if (at.normal.dot(sunlight().direction) < 0.3f) return;
    const float albedo = a.albedo.at<cv::Vec4f>(v - a.region.y, u - a.region.x)[2],
                x = landingOf(at.position).x() - kEdge;
    if (x < -0.02f) dark += albedo, ++darks;
    if (x > 0.02f) lit += albedo, ++lits;
  });
  ASSERT_GT(std::min(darks, lits), 100);
  EXPECT_NEAR(dark / darks, lit / lits, 0.15 * lit / lits);  // half as bright in the shade
}

}  // namespace
}  // namespace calipso::render
