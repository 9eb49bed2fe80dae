#include "place/plane_mirror.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "place/drawn_out.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kCentre(0.0, 0.4, 0.2);
constexpr float kTrueStrength = 0.8f;
const cv::Vec3f kSky(0.6f, 0.5f, 0.4f), kObject(0.05f, 0.1f, 0.3f);

// A ball just over the table, and what the table mirrors of it.
struct Mirrored {
  Surface surface = makeSurface(ballAt(kCentre));
  Actor actor = makeActor(surface, surface.key_vertices, camera());
  MirrorImage image = mirrorImage(
      {&actor}, [](int, const SurfacePoint&) { return kObject; }, table(), camera(), cv::Mat());
  cv::Mat known = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255));

  Mirrored() {
    const VisibilityBuffer buffer({0, 0, kWidth, kHeight}, {&actor.screen});
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        if (buffer.ids(v)[u] != VisibilityBuffer::kNothing) known.at<std::uint8_t>(v, u) = 0;
      }
    }
  }
};

// A dim table with a soft pattern and grain, polished or not.
cv::Mat tablePicture(const cv::Mat& added) {
  cv::Mat picture(kHeight, kWidth, CV_32FC3), grain(kHeight, kWidth, CV_32FC3);
  cv::RNG random(11);
  random.fill(grain, cv::RNG::NORMAL, 0.0, 0.003);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const float x = 0.2f + 0.004f * std::sin(0.3f * u + 0.1f * v) + 0.0005f * v;
      picture.at<cv::Vec3f>(v, u) = cv::Vec3f(0.7f * x, 0.9f * x, x);
    }
  }
  picture += grain;
  if (!added.empty()) picture += added;
  return picture;
}

TEST(PlaneMirror, ImageLiesWhereAPointsMirrorImageIsSeen) {
  const Mirrored m;
  // The lowest point of the ball, 10 cm over the table, is mirrored 10 cm below it.
  const Eigen::Vector2d below = camera().project(
      Eigen::Vector3d(camera().world_from_camera.inverse() * Eigen::Vector3d(0.0, 0.4, -0.2)));
  EXPECT_GT(m.image.cover.at<float>(cvRound(below.y()), cvRound(below.x())), 0.0f);
  // All of it is seen through the table: below the lowest row of which the plane shows what is
  // behind the ball nothing is mirrored.
  const Eigen::Vector2d lowest = camera().project(Eigen::Vector3d(
      camera().world_from_camera.inverse() * Eigen::Vector3d(0.0, 0.4, -0.2 - 1.5 * kBallRadius)));
  for (int v = cvRound(lowest.y()) + 1; v < kHeight; ++v)
    EXPECT_EQ(cv::countNonZero(m.image.cover.row(v)), 0);
}

TEST(PlaneMirror, ReflectanceGrowsTowardsGrazing) {
  const Mirrored m;
  cv::Mat rows;
  cv::reduce(m.image.cover, rows, 1, cv::REDUCE_MAX);
  const cv::Rect box = cv::boundingRect(m.image.cover > 0.0f);
  EXPECT_GT(rows.at<float>(box.y), rows.at<float>(box.br().y - 1));
}

TEST(PlaneMirror, FindsStrengthAndSurroundingsOfAPolishedTable) {
  const Mirrored m;
  PlaneMirror truth;
  truth.strength = kTrueStrength, truth.surroundings = kSky, truth.slope = 0.02f;
  const PlaneMirror found =
      establishMirror(m.image, tablePicture(addedBy(truth, m.image)), m.known, cv::Mat());
  ASSERT_TRUE(found.established());
  EXPECT_FLOAT_EQ(found.slope, 0.02f);
  // What it adds is one colour: strength and surroundings are known together only.
  const cv::Mat cover = m.image.cover > 0.0f;
  const cv::Scalar wanted = cv::mean(addedBy(truth, m.image), cover),
                   got = cv::mean(addedBy(found, m.image), cover);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(got[c], wanted[c], 0.15 * std::abs(wanted[c]));
}

TEST(PlaneMirror, IsNotFoundOnAMattTable) {
  const Mirrored m;
  EXPECT_FALSE(establishMirror(m.image, tablePicture(cv::Mat()), m.known, cv::Mat()).established());
}

TEST(PlaneMirror, SomethingDarkBesideItsPlaceIsNone) {
  const Mirrored m;
  PlaneMirror truth;
  truth.strength = kTrueStrength, truth.surroundings = kSky;
  cv::Mat beside;
  const cv::Mat by = (cv::Mat_<double>(2, 3) << 1, 0, 18, 0, 1, 0);
  cv::warpAffine(addedBy(truth, m.image), beside, by, beside.size());
  EXPECT_FALSE(establishMirror(m.image, tablePicture(beside), m.known, cv::Mat()).established());
}

// With two colours the strength is known.
TEST(PlaneMirror, StrongerThanSteelIsNone) {
  Mirrored m;
  const cv::Rect half(0, 0, m.image.box.x + m.image.box.width / 2, kHeight);
  cv::Mat colour = m.image.colour(half);
  colour *= 4.0;
  PlaneMirror truth;
  truth.surroundings = kSky;
  for (const float strength : {5.0f, 20.0f}) {
    truth.strength = strength;
    const cv::Mat picture = tablePicture(addedBy(truth, m.image));
    EXPECT_EQ(establishMirror(m.image, picture, m.known, cv::Mat()).established(), strength < 10.0f)
        << strength;
  }
}

TEST(PlaneMirror, UnmirroredTakesAwayWhatWasAdded) {
  const Mirrored m;
  PlaneMirror mirror;
  mirror.strength = kTrueStrength, mirror.surroundings = kSky;
  mirror.at_key = addedBy(mirror, m.image);
  const cv::Mat plain = tablePicture(cv::Mat());
  cv::Mat codes(plain.size(), CV_32FC3), wanted(plain.size(), CV_32FC3);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      for (int c = 0; c < 3; ++c) {
        const float x = plain.at<cv::Vec3f>(v, u)[c];
        wanted.at<cv::Vec3f>(v, u)[c] = codeFromLinear(x);
        codes.at<cv::Vec3f>(v, u)[c] = codeFromLinear(x + mirror.at_key.at<cv::Vec3f>(v, u)[c]);
      }
    }
  }
  EXPECT_LT(cv::norm(unmirrored(mirror, codes), wanted, cv::NORM_INF), 0.1);
}

// The ball over a polished table, as a clip of one frame.
std::shared_ptr<const Prepared> polished(cv::Mat& bgr) {
  const ObjectModel ball = ballAt(kCentre);
  ClipFrame frame = frameWithBall(ball);
  const Mirrored m;
  PlaneMirror truth;
  truth.strength = 2.0f, truth.surroundings = cv::Vec3f(1.2f, 1.0f, 0.8f);
  const cv::Mat added = addedBy(truth, m.image);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (frame.labels.at<std::uint8_t>(v, u) != 0) continue;
      for (int c = 0; c < 3; ++c) {
        const float lit = linearFromCode(tableColour(60, 60)[c]) + added.at<cv::Vec3f>(v, u)[c];
        frame.bgr.at<cv::Vec3b>(v, u)[c] = quantise(codeFromLinear(std::max(0.0f, lit)));
      }
    }
  }
  bgr = frame.bgr.clone();
  ClipSample clip;
  clip.add(frame);
  RenderParams params;
  params.planes = table();
  return std::make_shared<Prepared>(prepare(clip, {ball}, params));
}

FrameInput frameOf(const cv::Mat& bgr, const Prepared& p, double right, bool removed) {
  FrameInput in{bgr, p.key_labels, p.camera, 0, {}, {}};
  ObjectInFrame o;
  o.name = "ball", o.edited = true, o.removed = removed;
  o.vertices = p.surfaces[0].key_vertices;
  for (Eigen::Vector3f& x : o.vertices) x.x() += static_cast<float>(right);
  in.objects.push_back(o);
  return in;
}

TEST(PlaneMirror, GoesWithTheObject) {
  cv::Mat bgr;
  const auto p = polished(bgr);
  ASSERT_TRUE(p->mirror.established());
  RenderParams params;
  params.planes = table(), params.add_noise = false;
  Renderer renderer(p, params);
  const cv::Mat mirrored = Mirrored().image.cover > 0.0f, open = mirrored & (p->key_labels == 0);
  cv::Mat inner;
  cv::erode(open, inner, cv::Mat::ones(5, 5, CV_8U));
  ASSERT_GT(cv::countNonZero(inner), 50);
  const cv::Mat before = bgr.clone();
  const cv::Vec3b plain = tableColour(60, 60);
  const cv::Scalar was = cv::mean(bgr, inner),
                   gone = cv::mean(renderer.composite(frameOf(bgr, *p, 0.0, true)).bgr, inner);
  EXPECT_EQ(cv::norm(bgr, before, cv::NORM_INF), 0.0);
  for (int c = 0; c < 3; ++c)
    EXPECT_LT(std::abs(gone[c] - plain[c]), 0.35 * std::abs(was[c] - plain[c])) << "channel " << c;
  // At rest every pixel is the video's; moved by 15 cm the reflection is there and no longer here.
  EXPECT_EQ(cv::norm(renderer.composite(frameOf(bgr, *p, 0.0, false)).bgr, bgr, cv::NORM_INF), 0.0);
  const cv::Mat moved = renderer.composite(frameOf(bgr, *p, 0.15, false)).bgr;
  cv::Mat there;
  const cv::Mat by = (cv::Mat_<double>(2, 3) << 1, 0, 30, 0, 1, 0);
  cv::warpAffine(inner, there, by, inner.size(), cv::INTER_NEAREST);
  EXPECT_LT(cv::mean(moved, there)[0], cv::mean(bgr, there)[0] - 0.3 * (plain[0] - was[0]));
}

// What lies behind its outline may have changed since the key frame (water): what is missed of it
// there is told by what is there now.
TEST(PlaneMirror, AtRestTheFrameComesBackWhateverLiesBehind) {
  cv::Mat bgr;
  auto p = std::make_shared<Prepared>(*polished(bgr));
  const cv::Mat& invented = p->background.invented;
  cv::Mat origin(invented.size(), CV_16SC2, cv::Scalar(-1, -1));
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (invented.at<std::uint8_t>(v, u) != 0)
        origin.at<cv::Vec2s>(v, u) = {static_cast<short>(u % 30), static_cast<short>(v)};
    }
  }
  p->background.live = LiveFill(origin, cv::Mat::zeros(invented.size(), CV_32FC3), invented,
                                unmirroredCodes(p->mirror, bgr), p->key_labels);
  cv::Mat later = bgr.clone();
  later.colRange(0, 31) *= 1.5;
  RenderParams params;
  params.planes = table(), params.add_noise = params.keep_still = false;
  const cv::Mat out = Renderer(p, params).composite(frameOf(later, *p, 0.0, false)).bgr;
  EXPECT_LE(cv::norm(out, later, cv::NORM_INF), 2.0);
}

// What the blur gives must not hang on the box that it is asked for: what rests would be repainted.
TEST(PlaneMirror, IsDrawnOutAlikeInABoxAndInTheWholePicture) {
  const cv::Size size(241, 187);  // no multiple of any level's pixels
  cv::Mat values = cv::Mat::zeros(size, CV_32FC4), spread(size, CV_32F);
  cv::rectangle(values, {100, 90}, {120, 110}, cv::Scalar(0.8, 0.4, 0.2, 1.0), cv::FILLED);
  for (int v = 0; v < size.height; ++v) spread.row(v) = 2.0 + 0.03 * v;
  const cv::Rect box = cv::Rect(32, 32, 192, 155) & cv::Rect({0, 0}, size);
  for (const float across : {0.2f, 0.45f, 0.8f}) {
    const cv::Mat whole = DrawnOut(spread, across, 1.0f)(values),
                  part = DrawnOut(spread(box), across, 1.0f)(values(box));
    EXPECT_LT(cv::norm(whole(box), part, cv::NORM_INF), 1e-4) << across;
  }
}

TEST(PlaneMirror, IsSharpOnPolishedPlanesAlone) {
  PlaneMirror mirror;
  EXPECT_FALSE(mirrorsSharply(mirror) || isWater(mirror));
  mirror.strength = 1.0f;
  EXPECT_TRUE(mirrorsSharply(mirror) && !isWater(mirror));
  mirror.slope = 0.04f;
  EXPECT_TRUE(isWater(mirror) && !mirrorsSharply(mirror));
}

// Waves all over a lake, and the dark mirror image of a hull.
struct Lake {
  const cv::Rect hull{60, 40, 50, 40};
  cv::Mat lake = cv::Mat(kHeight, kWidth, CV_8UC3),
          plane = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255));
  PlaneMirror mirror;

  Lake(int darkest, int brightest) {
    cv::RNG random(5);
    random.fill(lake, cv::RNG::UNIFORM, darkest, brightest);
    mirror.strength = 1.0f, mirror.at_key = cv::Mat::zeros(lake.size(), CV_32FC3);
    mirror.at_key(hull).setTo(cv::Scalar::all(-0.1));
  }
};

// There are waves in it, or none.
TEST(PlaneMirror, WhatIsPlainWithoutItIsLost) {
  Lake l(100, 160);
  auto& [hull, lake, plane, mirror] = l;
  EXPECT_EQ(cv::countNonZero(lostInMirror(mirror, lake, plane)), 0);
  lake(hull).setTo(cv::Scalar::all(130));
  const cv::Mat lost = lostInMirror(mirror, lake, plane);
  EXPECT_EQ(cv::countNonZero(lost(hull)), hull.area());
  EXPECT_EQ(cv::countNonZero(lost), hull.area());
  cv::Mat shadow = plane.clone();
  shadow(hull).setTo(0);
  EXPECT_EQ(cv::countNonZero(lostInMirror(mirror, lake, shadow)), 0);
}

// The mirror image of a hull that is taken off two pixels beside its place leaves a dark and a pale
// line.
TEST(PlaneMirror, OutlinesBesideTheirPlaceAreLost) {
  Lake l(125, 135);
  auto& [hull, lake, plane, mirror] = l;
  EXPECT_EQ(cv::countNonZero(lostInMirror(mirror, lake, plane)), 0);
  const cv::Rect dark(hull.x - 2, hull.y, 2, hull.height),
      pale(hull.br().x - 2, hull.y, 2, hull.height);
  lake(dark) -= cv::Scalar::all(40), lake(pale) += cv::Scalar::all(40);
  const cv::Mat lost = lostInMirror(mirror, lake, plane);
  EXPECT_EQ(cv::countNonZero(lost(dark)), dark.area());
  EXPECT_EQ(cv::countNonZero(lost(pale)), pale.area());
  const cv::Rect inside(hull.x + 6, hull.y + 6, hull.width - 12, hull.height - 12);
  EXPECT_EQ(cv::countNonZero(lost(inside)), 0);
}

}  // namespace
}  // namespace calipso::render
