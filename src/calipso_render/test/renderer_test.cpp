#include "calipso_render/renderer.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/shadow_map.hpp"
#include "plane_view.hpp"
#include "render_test_scene.hpp"
#include "umbra.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kCentre(0.0, 0.1, 0.12);

RenderParams params() {
  RenderParams p;
  p.planes = table();
  p.add_noise = false;
  return p;
}

struct Setting {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  std::shared_ptr<const Prepared> prepared;

  explicit Setting(const RenderParams& p) {
    ClipSample clip;
    clip.add(key);
    prepared = std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, p));
  }
  FrameInput input(bool edited, const Eigen::Vector3f& move) const {
    FrameInput in;
    in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera, in.stamp_ns = 7;
    ObjectInFrame ball;
    ball.name = "ball", ball.edited = edited;
    ball.vertices = prepared->surfaces[0].key_vertices;
    for (Eigen::Vector3f& x : ball.vertices) x += move;
    in.objects = {ball};
    return in;
  }
};

int changedPixels(const FrameOutput& out) { return cv::countNonZero(out.provenance); }

bool sameWhereOriginal(const FrameOutput& out, const cv::Mat& input) {
  for (int v = 0; v < input.rows; ++v) {
    for (int u = 0; u < input.cols; ++u) {
      if (out.provenance.at<std::uint8_t>(v, u) == kOriginal &&
          out.bgr.at<cv::Vec3b>(v, u) != input.at<cv::Vec3b>(v, u))
        return false;
    }
  }
  return true;
}

TEST(Renderer, NoEditLeavesEveryByte) {
  const Setting s(params());
  const FrameOutput out =
      Renderer(s.prepared, params()).composite(s.input(false, Eigen::Vector3f::Zero()));
  EXPECT_EQ(changedPixels(out), 0);
  EXPECT_EQ(cv::norm(out.bgr, s.key.bgr, cv::NORM_INF), 0.0);
}

TEST(Renderer, AnEditThatMovesNothingLeavesTheObject) {
  const Setting s(params());
  const FrameOutput out =
      Renderer(s.prepared, params()).composite(s.input(true, Eigen::Vector3f::Zero()));
  cv::Mat ball;
  cv::dilate(s.key.labels, ball, cv::Mat::ones(7, 7, CV_8U));
  EXPECT_GT(psnr(out.bgr, s.key.bgr, ball), 40.0);
  EXPECT_TRUE(sameWhereOriginal(out, s.key.bgr));
}

// With nothing kept, the residual makes up for all that drawing misses; farther away none of it is
// left.
TEST(Renderer, TheResidualGoesAlongWithSmallMovesOnly) {
  RenderParams drawn = params(), plain = params();
  drawn.keep_still = plain.keep_still = plain.carry_residual = false;
  const Setting s(drawn);
  const FrameInput rest = s.input(true, Eigen::Vector3f::Zero()),
                   far = s.input(true, {0.1f, 0.0f, 0.0f});
  EXPECT_EQ(cv::norm(Renderer(s.prepared, drawn).composite(rest).bgr, s.key.bgr, cv::NORM_INF),
            0.0);
  EXPECT_GT(cv::norm(Renderer(s.prepared, plain).composite(rest).bgr, s.key.bgr, cv::NORM_INF),
            0.0);
  EXPECT_EQ(cv::norm(Renderer(s.prepared, drawn).composite(far).bgr,
                     Renderer(s.prepared, plain).composite(far).bgr, cv::NORM_INF),
            0.0);
}

// Something without a model hides a piece of the ball: the residual puts it back there, too.
TEST(Renderer, WhatHidesAnObjectAtRestComesBackWithIt) {
  RenderParams drawn = params();
  drawn.keep_still = false;
  ClipFrame key = frameWithBall(ballAt(kCentre));
  const cv::Rect box = cv::boundingRect(key.labels),
                 pole(box.x + box.width / 2 - 8, box.y + box.height / 2 - 7, 16, 14);
  key.labels(pole).setTo(0), key.bgr(pole).setTo(cv::Scalar(30, 120, 40));
  ClipSample clip;
  clip.add(key);
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, drawn));
  ASSERT_FALSE(prepared->fronts[0].empty());
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true, ball.vertices = prepared->surfaces[0].key_vertices;
  const FrameOutput out =
      Renderer(prepared, drawn).composite({key.bgr, key.labels, key.camera, 7, {ball}, {}});
  EXPECT_EQ(cv::norm(out.bgr, key.bgr, cv::NORM_INF), 0.0);
}

TEST(Renderer, UnmovedSurfaceDrawsBackToItsPixels) {
  RenderParams p = params();
  p.keep_still = false;  // so that every pixel is really drawn
  const Setting s(p);
  const FrameOutput out = Renderer(s.prepared, p).composite(s.input(true, Eigen::Vector3f::Zero()));
  cv::Mat inside;
  cv::erode(s.key.labels, inside, cv::Mat::ones(7, 7, CV_8U));
  EXPECT_GT(psnr(out.bgr, s.key.bgr, inside), 50.0);
}

TEST(Renderer, MovedObjectLeavesTheTableBehind) {
  const Setting s(params());
  const FrameOutput out =
      Renderer(s.prepared, params()).composite(s.input(true, {0.25f, 0.0f, 0.0f}));
  EXPECT_TRUE(sameWhereOriginal(out, s.key.bgr));
  // Its centre has become table-like: no longer red against blue as the ball is.
  const Eigen::Vector2d q = camera().projectWorld(kCentre);
  const cv::Vec3b old_place = out.bgr.at<cv::Vec3b>(int(q.y()), int(q.x()));
  EXPECT_EQ(out.provenance.at<std::uint8_t>(int(q.y()), int(q.x())), kInvented);
  EXPECT_LT(double(old_place[2]) / old_place[0], 1.7);
  const Eigen::Vector2d r = camera().projectWorld(kCentre + Eigen::Vector3d(0.25, 0, 0));
  const cv::Vec3b new_place = out.bgr.at<cv::Vec3b>(int(r.y()), int(r.x()));
  EXPECT_EQ(out.provenance.at<std::uint8_t>(int(r.y()), int(r.x())), kRendered);
  EXPECT_GT(double(new_place[2]) / new_place[0], 1.7);
}

// The key frame with its ball edited to lie 30 cm further left.
FrameInput ballMovedLeft(const ClipFrame& key, const Prepared& prepared) {
  FrameInput in;
  in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera;
  ObjectInFrame moved;
  moved.name = "ball", moved.edited = true, moved.vertices = prepared.surfaces[0].key_vertices;
  for (Eigen::Vector3f& x : moved.vertices) x.x() -= 0.3f;
  in.objects = {moved};
  return in;
}

TEST(Renderer, WhatTheMaskMissesOfAMovedObjectGoesToo) {
  // A mask that stops five pixels short of the ball's right side, as a stroke can leave it.
  ClipFrame key = frameWithBall(ballAt(kCentre));
  const cv::Rect box = cv::boundingRect(key.labels);
  const cv::Rect missed(box.br().x - 5, box.y, 5, box.height);
  const cv::Mat ball = key.labels(missed).clone();
  key.labels(missed).setTo(0);
  ClipSample clip;
  clip.add(key);
  const auto prepared =
      std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, params()));
  const FrameInput in = ballMovedLeft(key, *prepared);
  const FrameOutput out = Renderer(prepared, params()).composite(in);
  cv::Mat left_over;
  cv::bitwise_and(ball != 0, out.provenance(missed) == kOriginal, left_over);
  EXPECT_EQ(cv::countNonZero(left_over), 0);
}

// The same for an object that moves: from the places that it shades in the views, against what was
// seen of the place.
TEST(Umbra, IsToldFromWhatTheViewsObjectsShade) {
  const cv::Vec3f umbra(0.6f, 0.5f, 0.45f);
  const Surface surface = makeSurface(ballAt({0.0, 0.1, kBallRadius}));
  Background plate;
  emptyTable().convertTo(plate.plate, CV_32F);
  plate.count = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(9)),
  plate.spread = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  std::vector<View> views;
  for (const float x : {-0.1f, 0.15f}) {
    Points vertices = surface.key_vertices;
    for (Eigen::Vector3f& p : vertices) p.x() += x;
    views.push_back({plate.plate.clone(),
                     cv::Mat::zeros(kHeight, kWidth, CV_8U),
                     camera(),
                     {makeActor(surface, vertices, camera())}});
    const std::vector<Occluder> occluder = {{&views.back().actors[0].vertices, &surface.triangles}};
    const ShadowMap sun(occluder, sunlight().direction.cast<double>(), {512, 0.025, 16}),
        sky(occluder, Eigen::Vector3d::UnitZ(), {256, kSkyRadius, 24});
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto r = receiverAt(table(), camera(), u, v);
        if (!r) continue;
        const float part = sun.visibility(r->position, r->normal),
                    open = sky.visibility(r->position, r->normal);
        cv::Vec3f& code = views.back().picture.at<cv::Vec3f>(v, u);
        for (int c = 0; c < 3; ++c)
          code[c] = codeFromLinear(linearFromRealCode(code[c]) *
                                   (umbra[c] * open + (1.0f - umbra[c]) * part));
      }
    }
  }
  const auto found = umbraInViews(views, table(), plate, sunlight());
  ASSERT_TRUE(found);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR((*found)[c], umbra[c], 0.03f) << c;  // the maps have other resolutions
  for (View& view : views) plate.plate.copyTo(view.picture);
  EXPECT_FALSE(
      umbraInViews(views, table(), plate, sunlight()));  // no shadow where one is predicted
}

// Near the ball the shadow is darker than the sun's absence makes it: the ball hides sky, too.
TEST(Renderer, TheDarkOfAShadowIsToldFromTheHiddenSky) {
  const cv::Vec3f umbra(0.45f, 0.4f, 0.35f);
  const ObjectModel ball = ballAt({0.0, 0.1, kBallRadius});
  ClipFrame frame = frameWithBall(ball);
  const Surface surface = makeSurface(ball);
  const std::vector<Occluder> occluder = {{&surface.key_vertices, &surface.triangles}};
  const ShadowMap sun(occluder, sunlight().direction.cast<double>(), {512, 0.025, 16}),
      sky(occluder, Eigen::Vector3d::UnitZ(), {256, kSkyRadius, 24});
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = receiverAt(table(), frame.camera, u, v);
      if (frame.labels.at<std::uint8_t>(v, u) != 0 || !r) continue;
      const float part = sun.visibility(r->position, r->normal),
                  open = sky.visibility(r->position, r->normal);
      for (int c = 0; c < 3; ++c) {
        std::uint8_t& code = frame.bgr.at<cv::Vec3b>(v, u)[c];
        code = quantise(
            codeFromLinear(linearFromCode(code) * (umbra[c] * open + (1.0f - umbra[c]) * part)));
      }
    }
  }
  ClipSample clip;
  clip.add(frame);
  const Prepared prepared = prepare(clip, {ball}, params());
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(prepared.umbra[c], umbra[c], 0.05f) << c;  // the table behind it is invented
}

TEST(Renderer, AMovedShadowTakesItsWholeEdgeAlong) {
  const Setting s(params());
  const FrameOutput out =
      Renderer(s.prepared, params()).composite(s.input(true, {0.25f, 0.0f, 0.0f}));
  const Actor original =
      makeActor(s.prepared->surfaces[0], s.prepared->surfaces[0].key_vertices, camera());
  const ShadowMap sun({{&original.vertices, &original.surface->triangles}},
                      s.prepared->light.light.direction.cast<double>(), {512, 0.025, 16});
  cv::Mat shaded = cv::Mat::zeros(kHeight, kWidth, CV_8U), edge;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto receiver = receiverAt(params().planes, camera(), u, v);
      if (receiver && sun.visibility(receiver->position, receiver->normal) < 0.5f)
        shaded.at<std::uint8_t>(v, u) = 255;
    }
  }
  ASSERT_GT(cv::countNonZero(shaded), 50);
  cv::dilate(shaded, edge, cv::Mat::ones(7, 7, CV_8U));  // three pixels beyond the predicted shadow
  cv::Mat kept = edge & (out.provenance == kOriginal);
  EXPECT_LT(cv::countNonZero(kept), cv::countNonZero(edge) / 50);
}

// Water, or a light that was told wrongly: where the ball casts none in the video, it casts none
// when it is moved.
TEST(Renderer, CastsShadowsOnlyWhereTheVideoShowsThem) {
  const ObjectModel ball = ballAt(kCentre);
  const Surface surface = makeSurface(ball);
  const ShadowMap sun({{&surface.key_vertices, &surface.triangles}},
                      sunlight().direction.cast<double>(), {512, 0.025, 16});
  for (const bool shadow : {true, false}) {
    ClipFrame key = frameWithBall(ball);
    cv::RNG random(5);
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        if (key.labels.at<std::uint8_t>(v, u) != 0) continue;
        const auto r = receiverAt(table(), key.camera, u, v);
        const float light =
            shadow && r ? 0.4f + 0.6f * sun.visibility(r->position, r->normal) : 1.0f;
        key.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(
            quantise(codeFromLinear(0.4f * light) + static_cast<float>(random.uniform(-3, 4))));
      }
    }
    ClipSample clip;
    clip.add(key);
    const auto prepared = std::make_shared<const Prepared>(prepare(clip, {ball}, params()));
    const bool remarked =
        std::any_of(prepared->remarks.begin(), prepared->remarks.end(), [](const std::string& r) {
          return r.find("not seen in the picture") != std::string::npos;
        });
    EXPECT_EQ(remarked, !shadow);
    const FrameInput in = ballMovedLeft(key, *prepared);
    const FrameOutput out = Renderer(prepared, params()).composite(in);
    const Actor now = makeActor(prepared->surfaces[0], in.objects[0].vertices, key.camera);
    const ShadowMap cast({{&now.vertices, &now.surface->triangles}},
                         prepared->light.light.direction.cast<double>(), {512, 0.025, 16});
    int dark = 0, all = 0;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto r = receiverAt(table(), key.camera, u, v);
        if (!r || cast.visibility(r->position, r->normal) > 0.1f ||
            out.provenance.at<std::uint8_t>(v, u) == kInvented)
          continue;
        const cv::Vec3b c = out.bgr.at<cv::Vec3b>(v, u);
        if (std::abs(c[0] - c[2]) > 12) continue;  // the ball itself
        ++all, dark += c[1] < 140;                 // the table has 168
      }
    }
    ASSERT_GT(all, 50);
    if (shadow)
      EXPECT_GT(dark, all / 2);
    else
      EXPECT_LT(dark, all / 20);
  }
}

TEST(Renderer, SameInputGivesSameBytes) {
  RenderParams p = params();
  p.add_noise = true;
  const Setting s(p);
  Renderer first(s.prepared, p), second(s.prepared, p);
  const FrameOutput a = first.composite(s.input(true, {0.05f, 0.0f, 0.1f}));
  second.composite(s.input(true, {0.2f, 0.0f, 0.0f}));  // what was drawn before must not matter
  const FrameOutput b = second.composite(s.input(true, {0.05f, 0.0f, 0.1f}));
  EXPECT_EQ(cv::norm(a.bgr, b.bgr, cv::NORM_INF), 0.0);
}

TEST(Renderer, SameBytesForAnyNumberOfThreads) {
  RenderParams p = params();
  p.add_noise = true;
  const int usual = omp_get_max_threads();
  std::vector<cv::Mat> pictures;
  for (const int threads : {1, 2, 5}) {
    omp_set_num_threads(threads);
    const Setting s(p);
    pictures.push_back(Renderer(s.prepared, p).composite(s.input(true, {0.05f, 0.0f, 0.1f})).bgr);
  }
  omp_set_num_threads(usual);
  EXPECT_EQ(cv::norm(pictures[0], pictures[1], cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(pictures[0], pictures[2], cv::NORM_INF), 0.0);
}

TEST(PlaneView, AgreesWithTheReceiverOfEveryPixel) {
  SupportPlane shelf;
  shelf.normal = Eigen::Vector3d(0.2, 0.0, 1.0).normalized(), shelf.offset = 0.05,
  shelf.x_range = Eigen::Vector2d(-0.1, 0.2);
  std::vector<SupportPlane> planes = table();
  planes.push_back(shelf);
  const PlaneView view(planes, camera());
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      Receiver found{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
      const bool seen = view.at(u, v, found);
      const auto expected = receiverAt(planes, camera(), u, v);
      ASSERT_EQ(seen, expected.has_value()) << u << ", " << v;
      if (!seen) continue;
      ASSERT_LT((found.position - expected->position).norm(),
                1e-5f * (1.0f + expected->position.norm()))
          << u << ", " << v;
      ASSERT_LT((found.normal - expected->normal).norm(), 1e-6f) << u << ", " << v;
    }
  }
}

TEST(Renderer, NearerObjectHidesTheOther) {
  const ObjectModel front = ballAt({0.0, -0.15, 0.12}, "front", 1),
                    back = ballAt({0.0, 0.25, 0.12}, "back", 2);
  ClipSample clip;
  const ClipFrame key = frameWithBall(front);
  clip.add(key);
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {front, back}, params()));
  FrameInput in;
  in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera;
  ObjectInFrame moved;
  moved.name = "back", moved.edited = true;
  moved.vertices = prepared->surfaces[1].key_vertices;
  for (Eigen::Vector3f& x : moved.vertices) x.y() -= 0.2f;  // still behind the front one
  in.objects = {moved};
  const FrameOutput out = Renderer(prepared, params()).composite(in);
  const Eigen::Vector2d q = camera().projectWorld({0.0, -0.15, 0.12});
  EXPECT_EQ(out.provenance.at<std::uint8_t>(int(q.y()), int(q.x())), kOriginal);
}

TEST(Renderer, RefusesWhatDoesNotFit) {
  const Setting s(params());
  Renderer renderer(s.prepared, params());
  FrameInput small = s.input(true, Eigen::Vector3f::Zero());
  small.bgr = cv::Mat::zeros(10, 10, CV_8UC3);
  EXPECT_THROW(renderer.composite(small), std::invalid_argument);
  FrameInput unknown = s.input(true, Eigen::Vector3f::Zero());
  unknown.objects[0].name = "teapot";
  try {
    renderer.composite(unknown);
    FAIL() << "an unknown object was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("teapot"), std::string::npos);
  }
  FrameInput short_mesh = s.input(true, Eigen::Vector3f::Zero());
  short_mesh.objects[0].vertices.pop_back();
  EXPECT_THROW(renderer.composite(short_mesh), std::invalid_argument);
}

TEST(Prepare, NeedsAFrameAndDrawableMeshes) {
  EXPECT_THROW(prepare(ClipSample(), {ballAt(kCentre)}, params()), std::invalid_argument);
  ClipSample clip;
  clip.add(frameWithBall(ballAt(kCentre)));
  ObjectModel empty = ballAt(kCentre);
  empty.mesh.triangles.resize(0, 3);
  EXPECT_THROW(prepare(clip, {empty}, params()), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::render
