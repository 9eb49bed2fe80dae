// What no edit touches: objects in the shadow of edited ones, and scenery before them.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/renderer.hpp"
#include "calipso_render/shadow_map.hpp"
#include "place/key_cover.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kCentre(-0.15, 0.1, 0.12), kOther(0.15, 0.25, 0.12);

const cv::Scalar kMixedHue(60, 60, 200);

RenderParams params() {
  RenderParams p;
  p.planes = table();
  p.add_noise = false;
  return p;
}

// A ball that is edited, and one that is not.
struct TwoBalls {
  Eigen::Vector3d centre;  // of the first
  ClipFrame key = frameWithBall(ballAt(centre));
  RenderParams render = params();
  std::shared_ptr<const Prepared> prepared;

  // @param mixed px around the first one at which the other's pixels have another hue
  explicit TwoBalls(const RenderParams& p, const Eigen::Vector3d& centre = kCentre, int mixed = 0)
      : centre(centre), render(p) {
    const ObjectModel other = ballAt(kOther, "other", 2);
    const ClipFrame behind = frameWithBall(other);
    behind.bgr.copyTo(key.bgr, (behind.labels == 2) & (key.labels == 0));
    behind.labels.copyTo(key.labels, (behind.labels == 2) & (key.labels == 0));
    key.bgr.setTo(kMixedHue, mixedAround(mixed));
    ClipSample clip;
    clip.add(key);
    prepared = std::make_shared<const Prepared>(prepare(clip, {ballAt(centre), other}, render));
  }
  cv::Mat mixedAround(int px) const {
    cv::Mat near;
    cv::dilate(key.labels == 1, near, cv::Mat::ones(2 * px + 1, 2 * px + 1, CV_8U));
    return near & (key.labels == 2);
  }
  // @param touched the other one is edited, too, and stays where it is
  FrameOutput drawn(const Eigen::Vector3d& move, bool touched = false) const {
    FrameInput in;
    in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera, in.stamp_ns = 7;
    ObjectInFrame ball, other;
    ball.name = "ball", ball.edited = true;
    for (const Eigen::Vector3f& x : prepared->surfaces[0].key_vertices)
      ball.vertices.push_back(x + move.cast<float>());
    other.name = "other", other.edited = touched;
    if (touched) other.vertices = prepared->surfaces[1].key_vertices;
    in.objects = {ball, other};
    return Renderer(prepared, render).composite(in);
  }
  cv::Point at(const Eigen::Vector3d& x) const {
    const Eigen::Vector2d p = key.camera.projectWorld(x);
    return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
  }
};

TEST(Others, AnEditedObjectCastsItsShadowOnOneThatStays) {
  const TwoBalls s(params());
  const Eigen::Vector3d sun = s.prepared->light.light.direction.cast<double>();
  // between the sun and the other ball
  const FrameOutput out = s.drawn(kOther + 2.6 * kBallRadius * sun - kCentre);
  // The point of the other ball's front that looks at the sun as far as the camera sees it.
  const Eigen::Vector3d eye = s.key.camera.world_from_camera.translation();
  const Eigen::Vector3d facing = (sun + (eye - kOther).normalized()).normalized();
  const cv::Point p = s.at(kOther + kBallRadius * facing);
  ASSERT_EQ(s.key.labels.at<std::uint8_t>(p), 2);
  const Light& light = s.prepared->light.light;
  const Eigen::Vector3f n = facing.cast<float>();
  for (int c = 0; c < 3; ++c) {
    const float before = linearFromCode(s.key.bgr.at<cv::Vec3b>(p)[c]),
                now = linearFromCode(out.bgr.at<cv::Vec3b>(p)[c]);
    EXPECT_NEAR(now / before, diffuseShading(light, n, 0.0f)[c] / diffuseShading(light, n, 1.0f)[c],
                0.06f)
        << c;  // codes are rounded
  }
}

// An edited object at rest comes into another's shadow like one that is not edited, and so does
// the table around it.
TEST(Others, AShadowFallsOnAnEditedObjectAtRestAndAroundIt) {
  const TwoBalls s(params());
  const Eigen::Vector3d sun = s.prepared->light.light.direction.cast<double>(),
                        above = kOther + 2.6 * kBallRadius * sun - kCentre;
  const cv::Mat expected = s.drawn(above).bgr, touched = s.drawn(above, true).bgr;
  cv::Mat near, difference, other;
  cv::dilate(s.key.labels == 2, near, cv::Mat::ones(25, 25, CV_8U));
  cv::absdiff(expected, touched, difference);
  cv::inRange(difference, cv::Scalar(), cv::Scalar::all(24), other);
  other = (other == 0) & near & (s.key.labels != 1);
  EXPECT_LT(cv::countNonZero(other), cv::countNonZero(near) / 100);
  cv::Mat shaded;
  cv::absdiff(expected, s.key.bgr, difference);
  cv::inRange(difference, cv::Scalar(), cv::Scalar::all(24), shaded);
  EXPECT_GT(cv::countNonZero((shaded == 0) & near), cv::countNonZero(near) / 5);
}

// Its shadow leaves an object that stays with the one that cast it.
TEST(Others, AShadowOnOneThatStaysLeavesWithTheEditedObject) {
  const Eigen::Vector3d sun = sunlight().direction.cast<double>();
  TwoBalls s(params(), kOther + 2.6 * kBallRadius * sun);
  const auto sure = std::make_shared<Prepared>(*s.prepared);
  sure->light.light = sunlight(), sure->light.determined = sure->light.from_shadows = true;
  s.prepared = sure;
  const Eigen::Vector3d eye = s.key.camera.world_from_camera.translation();
  const Eigen::Vector3d facing = (sun + (eye - kOther).normalized()).normalized();
  const cv::Point p = s.at(kOther + kBallRadius * facing);
  ASSERT_EQ(s.key.labels.at<std::uint8_t>(p), 2);
  const cv::Vec3b lit = s.key.bgr.at<cv::Vec3b>(p);
  const Eigen::Vector3f n = facing.cast<float>();
  cv::Vec3b& shaded = s.key.bgr.at<cv::Vec3b>(p);
  for (int c = 0; c < 3; ++c)
    shaded[c] =
        quantise(codeFromLinear(linearFromCode(lit[c]) * diffuseShading(sunlight(), n, 0.0f)[c] /
                                diffuseShading(sunlight(), n, 1.0f)[c]));
  ASSERT_LT(shaded[1] + 20, lit[1]);
  const cv::Vec3b now = s.drawn({-3.0, 0.0, 0.0}).bgr.at<cv::Vec3b>(p);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(now[c], lit[c], 6) << c;  // codes are rounded
  sure->light.determined = false;  // then it may be the shadow of something else
  EXPECT_EQ(s.drawn({-3.0, 0.0, 0.0}).bgr.at<cv::Vec3b>(p), shaded);
}

// The other ball moves in the video, and passes before a place of the first one.
struct PassingBall : TwoBalls {
  ClipFrame passing;

  // @param over where it is seen as it passes
  // @param front where something stands before the first ball
  PassingBall(const cv::Rect& over, const cv::Rect& front) : TwoBalls(params()) {
    key.labels(front).setTo(0);
    passing = {key.bgr.clone(), key.labels.clone(), key.camera};
    passing.labels.setTo(0, passing.labels == 2);
    passing.labels(over).setTo(2), passing.bgr(over).setTo(kMixedHue);
    ClipSample clip;
    clip.add(key), clip.add(passing);
    prepared = std::make_shared<const Prepared>(
        prepare(clip, {ballAt(kCentre), ballAt(kOther, "other", 2)}, render));
  }
  // @param states of the objects in the frame in which it passes
  FrameOutput drawnPassing(const std::vector<ObjectInFrame>& states) const {
    FrameInput in;
    in.bgr = passing.bgr, in.labels = passing.labels, in.camera = passing.camera;
    in.objects = states;
    return Renderer(prepared, render).composite(in);
  }
};

cv::Point middleOfBall() {
  const Eigen::Vector2d p = camera().projectWorld(kCentre);
  return {cvRound(p.x()), cvRound(p.y())};
}

// None of it stays on a peg that stands before the first one if it is taken away.
TEST(Others, WhatPassesBeforeAFrontLeavesWithItsObject) {
  const cv::Point middle = middleOfBall();
  const cv::Rect peg(middle - cv::Point(8, 18), cv::Size(17, 18)),
      over(middle - cv::Point(2, 10), cv::Size(5, 5));
  const PassingBall s(over, peg);
  ASSERT_TRUE(s.prepared->moves[1]);
  ASSERT_EQ(cv::countNonZero(s.prepared->fronts[0](over)), over.area());
  ObjectInFrame other;
  other.name = "other", other.removed = true;
  const FrameOutput out = s.drawnPassing({other});
  EXPECT_EQ(cv::countNonZero(out.provenance(over) == kOriginal), 0);
  cv::Mat within = cv::Mat::zeros(out.bgr.size(), CV_8U);
  within(over).setTo(255);
  EXPECT_GT(psnr(out.bgr, s.key.bgr, within), 25.0);  // the plate shows the peg
}

// What it hides of the first one, which an edit moves by a little, is not what drawing that misses.
TEST(Others, WhatPassesLeavesNoHueOnAnObjectThatMovedALittle) {
  const cv::Rect over(middleOfBall() - cv::Point(3, 3), cv::Size(7, 7));
  const PassingBall s(over, cv::Rect());
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true;
  for (const Eigen::Vector3f& x : s.prepared->surfaces[0].key_vertices)
    ball.vertices.push_back(x + Eigen::Vector3f(0.01f, 0.0f, 0.0f));
  const cv::Mat out = s.drawnPassing({ball}).bgr;
  for (int u = over.br().x + 1; u < over.br().x + 5; ++u) {
    const cv::Vec3b beside = out.at<cv::Vec3b>(over.y + 3, u);
    EXPECT_LT(beside[2] - beside[0], 110) << u << " " << beside;  // of the hue: 140
  }
}

// What hid a part of an edited object at rest does not stay there once it has left.
TEST(Others, WhatHasLeftIsNotKeptOnAnEditedObjectAtRest) {
  const TwoBalls s(params(), kOther + Eigen::Vector3d(-0.06, -0.3, 0.0));
  const FrameOutput out = s.drawn({-0.4, 0.0, 0.0}, true);
  ASSERT_GT(cv::countNonZero(s.key.labels == 1), 100);
  EXPECT_EQ(cv::countNonZero((s.key.labels == 1) & (out.provenance == kOriginal)), 0);
}

// Where an object that is taken away has mixed into what stands behind it, that is drawn anew.
TEST(Others, WhatIsTakenAwayLeavesNoHueOnThem) {
  const Eigen::Vector3d before = kOther + Eigen::Vector3d(-0.06, -0.3, 0.0);
  const TwoBalls s(params(), before, 1);
  const cv::Mat mixed = s.mixedAround(1);
  ASSERT_GT(cv::countNonZero(mixed), 20);
  const FrameOutput out = s.drawn(kCentre - before);
  const auto redness = [](const cv::Mat& picture, const cv::Mat& where) {
    const cv::Scalar mean = cv::mean(picture, where);
    return mean[2] - mean[1];
  };
  const double own = redness(s.key.bgr, (s.key.labels == 2) & ~s.mixedAround(6));
  EXPECT_GT(redness(s.key.bgr, mixed), own + 50.0);
  EXPECT_LT(redness(out.bgr, mixed), own + 15.0);
}

// Of an object that moves in the video, the part that the frame shows as the key frame does is
// kept, byte by byte.
TEST(Others, APartOfAMovingObjectMayRest) {
  const RenderParams render = params();
  const ObjectModel ball = ballAt(kCentre);
  const ClipFrame key = frameWithBall(ball);
  ClipSample clip;
  clip.add(key);
  clip.add(frameWithBall(ballAt(kOther)));
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {ball}, render));
  ASSERT_TRUE(prepared->moves[0]);
  const cv::Rect box = cv::boundingRect(key.labels != 0);
  const int middle = box.y + box.height / 2;
  cv::Mat lower = key.labels != 0;
  lower.rowRange(0, middle).setTo(0);
  FrameInput in;
  in.bgr = key.bgr.clone(), in.labels = key.labels, in.camera = key.camera;
  cv::subtract(in.bgr, cv::Scalar::all(50), in.bgr, lower);
  ObjectInFrame state;
  state.name = "ball", state.edited = true, state.vertices = prepared->surfaces[0].key_vertices;
  in.objects = {state};
  const FrameOutput out = Renderer(prepared, render).composite(in);
  const int away = 6;  // px from the change
  for (int v = box.y - 4; v < middle - away; ++v) {
    for (int u = box.x - 4; u < box.br().x + 4; ++u)
      ASSERT_EQ(out.bgr.at<cv::Vec3b>(v, u), key.bgr.at<cv::Vec3b>(v, u)) << u << ", " << v;
  }
  cv::erode(lower, lower, cv::Mat::ones(2 * away + 1, 2 * away + 1, CV_8U));
  EXPECT_GT(psnr(out.bgr, key.bgr, lower), 30.0);
}

// A peg on a towel: narrow, but deep within the outline. A gap along the rim is misfit.
TEST(Others, WhatIsNarrowStandsInFrontIfItReachesIn) {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  const cv::Rect box = cv::boundingRect(key.labels != 0);
  const cv::Point middle = (box.tl() + box.br()) / 2;
  ASSERT_GT(box.height, 20);
  key.labels(cv::Rect(middle.x - 2, box.y, 5, box.height / 2)).setTo(0);
  key.labels(cv::Rect(box.x, box.y, 4, box.height)).setTo(0);
  ClipSample clip;
  clip.add(key);
  const Prepared prepared = prepare(clip, {ballAt(kCentre)}, params());
  ASSERT_FALSE(prepared.fronts[0].empty());
  EXPECT_NE(prepared.fronts[0].at<std::uint8_t>(middle.y - 4, middle.x), 0);
  EXPECT_EQ(prepared.fronts[0].at<std::uint8_t>(middle.y, box.x + 1), 0);
}

// A ball afloat: the water hides what is below it, but what the mask misses just above is the ball's.
TEST(Others, WhatAPlaneHidesBeginsBesideTheMask) {
  const ObjectModel afloat = ballAt({0.0, 0.0, 0.0});
  ClipFrame key = frameWithBall(afloat);
  RenderParams p = params();
  p.depth = 1.0f / groundNearness(table(), key.camera, cv::Mat());
  cv::Mat above = cv::Mat::zeros(key.labels.size(), CV_8U);
  const Surface surface = makeSurface(afloat);
  forEachPixelOf(makeActor(surface, surface.key_vertices, key.camera),
                 [&](int u, int v, const SurfacePoint& point) {
                   if (point.position.z() > 0.0f) above.at<std::uint8_t>(v, u) = 255;
                 });
  cv::Mat mask;  // a pixel short of the waterline
  cv::erode(above, mask, cv::Mat::ones(3, 3, CV_8U));
  key.labels.setTo(0, mask == 0);
  ClipSample clip;
  clip.add(key);
  const cv::Mat front = prepare(clip, {afloat}, p).fronts[0];
  EXPECT_EQ(cv::countNonZero(front & above & grown(mask, 1)), 0);
  EXPECT_GT(cv::countNonZero(front & ~grown(above, 2)), 100);
}

// A pose that the tracking has lost is no reason to draw an object where its mask does not have it.
TEST(Others, AMovingObjectIsNotDrawnAgainstItsMask) {
  const RenderParams render = params();
  const ObjectModel ball = ballAt(kCentre), other = ballAt(kOther, "other", 2);
  const auto frameWith = [&](const Eigen::Vector3d& place) {
    ClipFrame frame = frameWithBall(ball);
    const ClipFrame behind = frameWithBall(ballAt(place, "other", 2));
    behind.bgr.copyTo(frame.bgr, (behind.labels == 2) & (frame.labels == 0));
    behind.labels.copyTo(frame.labels, (behind.labels == 2) & (frame.labels == 0));
    return frame;
  };
  ClipSample clip;
  const ClipFrame key = frameWith(kOther);
  clip.add(key);
  clip.add(frameWith(kOther + Eigen::Vector3d(0.1, 0.0, 0.0)));
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {ball, other}, render));
  ASSERT_TRUE(prepared->moves[1]);
  FrameInput in;
  in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera;
  ObjectInFrame taken, state;
  taken.name = "ball", taken.removed = true;
  state.name = "other",
  state.world_from_object = Eigen::Translation3d(kCentre - kOther) * other.world_from_object;
  in.objects = {taken, state};
  const FrameOutput out = Renderer(prepared, render).composite(in);
  const Eigen::Vector2d p = key.camera.projectWorld(kCentre);
  EXPECT_NE(out.provenance.at<std::uint8_t>(static_cast<int>(p.y()), static_cast<int>(p.x())),
            kRendered);
}

TEST(Others, WhereNoShadowFallsTheirPixelsStay) {
  const TwoBalls s(params());
  const FrameOutput out = s.drawn({-0.02, 0.0, 0.0});
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (s.key.labels.at<std::uint8_t>(v, u) != 2) continue;
      ASSERT_EQ(out.bgr.at<cv::Vec3b>(v, u), s.key.bgr.at<cv::Vec3b>(v, u)) << u << ", " << v;
    }
  }
}

TEST(Others, WhatTheDepthImageHasNearerStaysInFront) {
  RenderParams p = params();
  p.depth = cv::Mat(kHeight, kWidth, CV_32F, cv::Scalar(5.0));
  // above the table's far end
  const Eigen::Vector3d place = kCentre + Eigen::Vector3d(0.0, 0.0, 0.22);
  const cv::Point middle = TwoBalls(params()).at(place);
  p.depth(cv::Rect(0, 0, middle.x, kHeight)).setTo(0.3);
  const TwoBalls s(p);
  const FrameOutput out = s.drawn(place - kCentre);
  const cv::Point left = middle - cv::Point(8, 0), right = middle + cv::Point(8, 0);
  EXPECT_EQ(out.bgr.at<cv::Vec3b>(left), s.key.bgr.at<cv::Vec3b>(left));
  EXPECT_EQ(out.provenance.at<std::uint8_t>(left), kOriginal);
  EXPECT_EQ(out.provenance.at<std::uint8_t>(right), kRendered);
  EXPECT_NE(out.bgr.at<cv::Vec3b>(right), s.key.bgr.at<cv::Vec3b>(right));
}

TEST(Others, AMatteStaysInFrontAndItsGreysMix) {
  RenderParams p = params();
  const Eigen::Vector3d place = kCentre + Eigen::Vector3d(0.0, 0.0, 0.22);
  const cv::Point middle = TwoBalls(params()).at(place);
  const TwoBalls bare(p);
  p.matte = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  p.matte(cv::Rect(middle.x - 6, 0, 6, kHeight)).setTo(255);
  p.matte(cv::Rect(middle.x, 0, 6, kHeight)).setTo(128);
  const TwoBalls s(p);
  const FrameOutput out = s.drawn(place - kCentre), free = bare.drawn(place - kCentre);
  const cv::Point full = middle - cv::Point(3, 0), half = middle + cv::Point(3, 0),
                  open = middle + cv::Point(9, 0);
  EXPECT_EQ(out.bgr.at<cv::Vec3b>(full), s.key.bgr.at<cv::Vec3b>(full));
  EXPECT_EQ(out.bgr.at<cv::Vec3b>(open), free.bgr.at<cv::Vec3b>(open));
  for (int c = 0; c < 3; ++c) {
    const float mixed = 0.5f * (linearFromCode(s.key.bgr.at<cv::Vec3b>(half)[c]) +
                                linearFromCode(free.bgr.at<cv::Vec3b>(half)[c]));
    EXPECT_NEAR(linearFromCode(out.bgr.at<cv::Vec3b>(half)[c]), mixed, 0.01f) << c;
  }
}

TEST(Others, ADepthImageOfAnotherSizeIsRefused) {
  RenderParams p = params();
  p.depth = cv::Mat(10, 10, CV_32F, cv::Scalar(1.0));
  EXPECT_THROW(TwoBalls{p}, std::invalid_argument);
}

}  // namespace
}  // namespace calipso::render
