#include "calipso_render/renderer.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {
namespace {

using namespace testing;

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

// What comes of a frame when its object is drawn anew where it is, with nothing kept.
cv::Mat drawnAtRest(const ClipFrame& key, const ObjectModel& model) {
  RenderParams drawn = params();
  drawn.keep_still = false;
  ClipSample clip;
  clip.add(key);
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {model}, drawn));
  ObjectInFrame ball;
  ball.name = model.name, ball.edited = true, ball.vertices = prepared->surfaces[0].key_vertices;
  return Renderer(prepared, drawn).composite({key.bgr, key.labels, key.camera, 7, {ball}, {}}).bgr;
}

// Something without a model hides a piece of the ball, in its middle or across its rim: the residual
// puts it back there, too.
TEST(Renderer, WhatHidesAnObjectAtRestComesBackWithIt) {
  for (const int up : {0, 16}) {
    ClipFrame key = frameWithBall(ballAt(kCentre));
    const cv::Rect box = cv::boundingRect(key.labels),
                   pole(box.x + box.width / 2 - 8, box.y + box.height / 2 - 7 - up, 16, 14);
    key.labels(pole).setTo(0), key.bgr(pole).setTo(cv::Scalar(30, 120, 40));
    EXPECT_EQ(cv::norm(drawnAtRest(key, ballAt(kCentre)), key.bgr, cv::NORM_INF), 0.0) << up;
  }
}

// Triangles that are thinner than a pixel's hundredth are drawn on their own.
TEST(Renderer, ThinTrianglesComeBackToo) {
  const ObjectModel whole = ballAt(kCentre);
  ObjectModel slivers = whole;
  TriangleMesh& m = slivers.mesh;
  const Eigen::Index vertices = m.vertices.rows(), triangles = m.triangles.rows();
  m.vertices.conservativeResize(vertices + triangles, 3);
  m.triangles.resize(3 * triangles, 3);
  for (int k = 0; k < triangles; ++k) {
    const Eigen::RowVector3i t = whole.mesh.triangles.row(k);
    const int p = static_cast<int>(vertices) + k;
    const Eigen::RowVector3d middle = 0.5 * (m.vertices.row(t[0]) + m.vertices.row(t[1]));
    m.vertices.row(p) = middle + 0.003 * (m.vertices.row(t[2]) - middle);
    m.triangles.row(3 * k) << t[0], t[1], p;
    m.triangles.row(3 * k + 1) << t[1], t[2], p;
    m.triangles.row(3 * k + 2) << t[2], t[0], p;
  }
  const ClipFrame key = frameWithBall(whole);
  EXPECT_EQ(cv::norm(drawnAtRest(key, slivers), key.bgr, cv::NORM_INF), 0.0);
}

TEST(Renderer, UnmovedSurfaceDrawsBackToItsPixels) {
  RenderParams p = params();
  p.keep_still = p.carry_residual = false;  // so that every pixel is really drawn
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

// A ball that rolls; two places are dark in its key frame: one is grey there instead of pale, as in
// a shadow, the other blue, as where a cloud has not yet come.
struct TwoDarkPlaces {
  const cv::Rect shadow{12, 84, 20, 20}, sky{128, 84, 20, 20};

  ClipFrame frame(int k) const {
    ClipFrame f = frameWithBall(ballAt(kCentre + 0.01 * k * Eigen::Vector3d::UnitX()));
    f.bgr(shadow).setTo(k == 0 ? cv::Scalar(120, 120, 120) : cv::Scalar(200, 200, 200));
    f.bgr(sky).setTo(k == 0 ? cv::Scalar(190, 128, 80) : cv::Scalar(200, 200, 200));
    return f;
  }
  // Pixels of the inner part of a place, of 144, that stay when the ball is moved.
  int kept(const cv::Rect& place, const RenderParams& p) const {
    ClipSample clip;
    for (int k = 0; k < 9; ++k) clip.add(frame(k));
    const auto prepared = std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, p));
    const FrameOutput out = Renderer(prepared, p).composite(ballMovedLeft(frame(0), *prepared));
    return cv::countNonZero(out.provenance(cv::Rect(place.x + 4, place.y + 4, 12, 12)) ==
                            kOriginal);
  }
};

TEST(Renderer, AMovingObjectsShadowDarkensAllColoursAlike) {
  const TwoDarkPlaces s;
  EXPECT_EQ(s.kept(s.shadow, params()), 0);
  EXPECT_EQ(s.kept(s.sky, params()), 144);
}

TEST(Renderer, AMovingObjectsShadowDoesNotFallOnTheSky) {
  const TwoDarkPlaces s;
  RenderParams p = params();
  p.planes.clear();
  p.depth = cv::Mat(kHeight, kWidth, CV_32F, cv::Scalar(1.0f));
  EXPECT_EQ(s.kept(s.shadow, p), 0);
  p.depth(s.shadow).setTo(0.0f);
  EXPECT_EQ(s.kept(s.shadow, p), 144);
}

// Where the video has it, a moving object hides the sky already: in another look it darkens the
// table beside it no further.
TEST(Renderer, AMovingObjectHidesTheSkyOnce) {
  const Eigen::Vector3d low(kCentre.x(), kCentre.y(), kBallRadius),
      there = low + Eigen::Vector3d(0.1, 0, 0);
  const ObjectModel model = ballAt(low), moved = ballAt(there);
  const ClipFrame now = frameWithBall(moved);
  ClipSample clip;
  clip.add(frameWithBall(model));
  auto prepared = std::make_shared<Prepared>(prepare(clip, {model}, params()));
  prepared->moves[0] = true, prepared->light.light = sunlight();
  prepared->umbra.setTo(cv::Scalar::all(128)), prepared->shadowless.release();
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true, ball.world_from_object = moved.world_from_object;
  for (const Eigen::Vector3f& x : prepared->surfaces[0].key_vertices)
    ball.vertices.push_back(x + Eigen::Vector3f(0.1f, 0, 0));
  const auto beside = [&] {  // on the side that the sun shines on
    const Eigen::Vector3d sun = sunlight().direction.cast<double>(),
                          side = Eigen::Vector3d(sun.x(), sun.y(), 0).normalized();
    const Eigen::Vector3d at = there + 1.5 * kBallRadius * side;
    const Eigen::Vector2d p = now.camera.projectWorld({at.x(), at.y(), 0.0});
    const cv::Rect patch(int(p.x()) - 1, int(p.y()) - 1, 3, 3);
    const FrameInput in{now.bgr, now.labels, now.camera, 7, {ball}, {}};
    const FrameOutput out = Renderer(prepared, params()).composite(in);
    return cv::mean(out.bgr(patch))[1] - cv::mean(now.bgr(patch))[1];
  };
  EXPECT_LT(beside(), -3.0);
  ball.observed = moved.world_from_object;
  EXPECT_NEAR(beside(), 0.0, 0.5);
}

// The mask has a rail above the ball that the model lacks. The ball's right side moves off: the
// rail above that side goes, too, also close to the side that rests, whose own part of it stays.
TEST(Renderer, WhatNoModelHasGoesWithThePartBesideIt) {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  const cv::Rect box = cv::boundingRect(key.labels);
  const int middle = box.x + box.width / 2;
  const cv::Rect rail(middle - 8, box.y - 5, 16, 2);
  key.labels(rail).setTo(kBallLabel), key.bgr(rail).setTo(cv::Scalar(40, 40, 200));
  ClipSample clip;
  clip.add(key);
  const auto prepared =
      std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, params()));
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true, ball.vertices = prepared->surfaces[0].key_vertices;
  for (Eigen::Vector3f& x : ball.vertices) {
    if (x.x() > static_cast<float>(kCentre.x()) + 0.01f) x.x() += 0.3f;
  }
  const FrameOutput out =
      Renderer(prepared, params()).composite({key.bgr, key.labels, key.camera, 7, {ball}, {}});
  const cv::Rect right(middle + 4, rail.y, 4, 2), left(middle - 8, rail.y, 4, 2);
  EXPECT_EQ(cv::countNonZero(out.provenance(right) == kOriginal), 0);
  EXPECT_EQ(cv::countNonZero(out.provenance(left) == kOriginal), left.area());
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

// What moves beside the edited ball shades it: what is kept of that is of the place it has now.
TEST(Renderer, SameBytesWhereverWhatMovesBesideWasBefore) {
  const ObjectModel beside = ballAt(kCentre, "beside", 2);
  ClipSample clip;
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  clip.add(key);
  Prepared learnt = prepare(clip, {ballAt(kCentre), beside}, params());
  learnt.moves[1] = true;
  const auto prepared = std::make_shared<const Prepared>(std::move(learnt));
  const Eigen::Vector3f moved(-0.05f, 0.0f, 0.0f);
  const auto frame = [&](float metres_towards_sun) {
    ObjectInFrame ball, other;
    ball.name = "ball", ball.edited = true, ball.vertices = prepared->surfaces[0].key_vertices;
    for (Eigen::Vector3f& x : ball.vertices) x += moved;
    other.name = "beside";
    other.world_from_object.translation() =
        kCentre + (moved + metres_towards_sun * prepared->light.light.direction).cast<double>();
    return FrameInput{key.bgr, key.labels, key.camera, 7, {ball, other}, {}};
  };
  const auto alone = [&](float metres) {
    return Renderer(prepared, params()).composite(frame(metres)).bgr;
  };
  Renderer one(prepared, params());
  for (const float metres : {0.25f, 2.0f, 2.0f, 0.25f})
    EXPECT_EQ(cv::norm(one.composite(frame(metres)).bgr, alone(metres), cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(alone(0.25f), alone(2.0f), cv::NORM_INF), 0.0);
}

// What a frame shows of the ball is kept only as long as its labels say the same.
TEST(Renderer, SameBytesWhateverStoodBeforeTheBall) {
  const Setting s(params());
  FrameInput free = s.input(true, {0.3f, 0.0f, 0.0f}), hidden = free;
  hidden.labels = free.labels.clone();
  const cv::Rect ball = cv::boundingRect(free.labels);
  hidden.labels(cv::Rect(ball.tl() + cv::Point(ball.size() / 4), ball.size() / 2)).setTo(2);
  const auto alone = [&](const FrameInput& in) {
    return Renderer(s.prepared, params()).composite(in).bgr;
  };
  Renderer one(s.prepared, params());
  for (const FrameInput* in : {&free, &hidden, &hidden, &free})
    EXPECT_EQ(cv::norm(one.composite(*in).bgr, alone(*in), cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(alone(free), alone(hidden), cv::NORM_INF), 0.0);
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
      Receiver found;
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
