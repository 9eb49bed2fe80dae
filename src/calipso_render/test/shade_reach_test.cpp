// Where the shade of an object that moves in the video is sought in a frame.

#include "frame/shade_reach.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"
#include "calipso_render/shadow_map.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3f kUp = Eigen::Vector3f::UnitZ();
const Eigen::Vector3d kHigh(0.0, 0.1, 0.25);

Points verticesAt(const Eigen::Vector3d& centre) {
  return makeSurface(ballAt(centre)).key_vertices;
}

cv::Mat reachOf(const Eigen::Vector3d& centre, bool confirmed,
                const std::vector<SupportPlane>& planes = table(),
                const Eigen::Vector3f& to_sun = sunlight().direction) {
  return shadeReach({ballAround(verticesAt(centre))}, sunRanges(to_sun, confirmed, kUp),
                    {PlaneView(planes, camera())}, {kWidth, kHeight});
}

// 255 where less than half of the sun is seen past the ball.
cv::Mat shadowOf(const Eigen::Vector3d& centre) {
  const Points vertices = verticesAt(centre);
  const Surface surface = makeSurface(ballAt(centre));
  const ShadowMap sun({{&vertices, &surface.triangles}}, sunlight().direction.cast<double>(),
                      {512, 0.025, 16});
  cv::Mat shaded = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = receiverAt(table(), camera(), u, v);
      if (r && sun.visibility(r->position, r->normal) < 0.5f) shaded.at<std::uint8_t>(v, u) = 255;
    }
  }
  return shaded;
}

TEST(ShadeReach, HoldsTheShadowAndLeavesTheRest) {
  const cv::Mat shadow = shadowOf(kHigh), reach = reachOf(kHigh, true);
  ASSERT_GT(cv::countNonZero(shadow), 50);
  EXPECT_EQ(cv::countNonZero(shadow & ~reach), 0);
  EXPECT_LT(cv::countNonZero(reach), kWidth * kHeight / 2);
}

TEST(ShadeReach, AnUnconfirmedSunMayStandAnywhere) {
  const cv::Mat confirmed = reachOf(kHigh, true), anywhere = reachOf(kHigh, false);
  EXPECT_EQ(cv::countNonZero(shadowOf(kHigh) & ~anywhere), 0);
  EXPECT_GT(cv::countNonZero(anywhere), cv::countNonZero(confirmed));
}

TEST(ShadeReach, AnUnconfirmedSunMayStandAsLowAsItWasFitted) {
  const Eigen::Vector3f low = Eigen::Vector3f(1.0f, 0.0f, 0.1f).normalized();
  EXPECT_EQ(
      cv::countNonZero(reachOf(kHigh, true, table(), low) & ~reachOf(kHigh, false, table(), low)),
      0);
}

TEST(ShadeReach, IsNowhereWhereNothingTakesShade) {
  EXPECT_EQ(cv::countNonZero(reachOf(kHigh, false, {})), 0);
}

// A ball that flies to the right above the table, and at the last frame the shadow of a cloud at
// the left, far from the ball's own.
struct Passing {
  static constexpr int kFrames = 9;
  const cv::Rect cloud{4, 80, 30, 30};
  std::vector<ClipFrame> frames;
  cv::Mat shadow;  // of the ball at the last frame, beside the ball
  std::shared_ptr<const Prepared> prepared;

  static Eigen::Vector3d centre(int k) { return {-0.25 + 0.05 * k, 0.1, 0.2}; }

  // @param brightness part of the setting's; noise: deviation, code values
  explicit Passing(double brightness = 1.0, double noise = 0.0) {
    ClipSample clip;
    cv::RNG rng(7);
    for (int k = 0; k < kFrames; ++k) {
      ClipFrame f = frameWithBall(ballAt(centre(k)));
      shadow = shadowOf(centre(k)) & (f.labels == 0);
      if (k + 1 == kFrames) shadow(cloud).setTo(255);
      const cv::Mat dim = 0.6 * emptyTable();
      dim.copyTo(f.bgr, shadow);
      shadow(cloud).setTo(0);
      cv::Mat grain(f.bgr.size(), CV_32FC3), grainy;
      rng.fill(grain, cv::RNG::NORMAL, 0.0, std::max(noise, 1e-6));
      f.bgr.convertTo(grainy, CV_32F, brightness);
      cv::Mat(grainy + grain).convertTo(f.bgr, CV_8U);
      f.poses = {{kBallLabel, poseAt(k)}};
      frames.push_back(f), clip.add(f);
    }
    Prepared learnt = prepare(clip, {ballAt(centre(0))}, params());
    learnt.light.light.direction = sunlight().direction, learnt.light.determined = true;
    learnt.light.from_shadows = true;
    prepared = std::make_shared<const Prepared>(std::move(learnt));
  }

  static Eigen::Isometry3d poseAt(int k) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = centre(k);
    return pose;
  }

  FrameOutput removed(const std::optional<Eigen::Isometry3d>& observed) const {
    return removed(observed, frames.back());
  }
  FrameOutput removed(const std::optional<Eigen::Isometry3d>& observed,
                      const ClipFrame& last) const {
    FrameInput in;
    in.bgr = last.bgr, in.labels = last.labels, in.camera = last.camera;
    ObjectInFrame ball;
    ball.name = "ball", ball.removed = true, ball.observed = observed;
    in.objects = {ball};
    return Renderer(prepared, params()).composite(in);
  }
};

TEST(Renderer, TakesOutThePassingShadowOfAnObjectAndNoOther) {
  const Passing p;
  ASSERT_TRUE(p.prepared->moves[0]);
  const FrameOutput out = p.removed(Passing::poseAt(Passing::kFrames - 1));
  ASSERT_GT(cv::countNonZero(p.shadow), 100);
  EXPECT_GT(psnr(out.bgr, emptyTable(), p.shadow), 35.0);
  EXPECT_EQ(cv::countNonZero(out.provenance(p.cloud)), 0) << "the cloud's is the video's";
}

// A ball that is painted, and follows the video, has the video's own shadow; one that does not, or
// that another sun shines on, has a new one.
TEST(Renderer, TheShadowOfWhatFollowsTheVideoIsTheVideos) {
  const Passing p;
  const ClipFrame& last = p.frames.back();
  FrameInput in;
  in.bgr = last.bgr, in.labels = last.labels, in.camera = last.camera;
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true, ball.observed = Passing::poseAt(Passing::kFrames - 1);
  ball.world_from_object = *ball.observed;
  ball.vertices = transformed(p.prepared->surfaces[0].object_vertices, *ball.observed);
  ball.look.albedo = cv::Vec3f(0.1f, 0.1f, 0.6f);
  in.objects = {ball};
  Renderer renderer(p.prepared, params());
  cv::Mat around, shadow = p.shadow.clone();
  cv::dilate(last.labels, around, cv::Mat::ones(21, 21, CV_8U));
  shadow.setTo(0, around);
  ASSERT_GT(cv::countNonZero(shadow), 100);
  EXPECT_EQ(cv::norm(renderer.composite(in).bgr, last.bgr, cv::NORM_INF, shadow), 0.0);
  const Eigen::Vector3f& sun = p.prepared->light.light.direction;
  in.sun.direction = sun.cwiseProduct(Eigen::Vector3f(-1, -1, 1));
  EXPECT_GT(cv::norm(renderer.composite(in).bgr, last.bgr, cv::NORM_INF, shadow), 20.0);
  in.sun.direction.reset();
  for (Eigen::Vector3f& x : in.objects[0].vertices) x.y() += 0.05f;
  EXPECT_GT(cv::norm(renderer.composite(in).bgr, last.bgr, cv::NORM_INF, shadow), 20.0);
}

// A quarter of the ball that its mask misses; a hand beside it stays.
TEST(Renderer, TakesOutWhatAMaskMissesOfAnObjectThatIsFollowed) {
  const Passing p;
  ClipFrame last = p.frames.back();
  const cv::Rect ball = cv::boundingRect(last.labels), hand(ball.br().x + 6, ball.y, 12, 12);
  const cv::Mat left = cv::Mat::zeros(last.labels.size(), CV_8U);
  left(cv::Rect(ball.x, ball.y, ball.width / 4, ball.height)).setTo(255);
  const cv::Mat missed = left & last.labels;
  last.labels.setTo(0, left);
  last.bgr(hand).setTo(cv::Scalar(120, 150, 220));
  const FrameOutput out = p.removed(Passing::poseAt(Passing::kFrames - 1), last);
  EXPECT_GT(cv::countNonZero(missed), 100);
  EXPECT_GT(psnr(out.bgr, emptyTable(), missed), 35.0);
  EXPECT_EQ(cv::norm(out.bgr(hand), last.bgr(hand), cv::NORM_INF), 0.0);
}

// Where no pose is known of it in a frame, its mask tells where it is.
TEST(Renderer, TakesOutWhatAMaskMissesOfAnObjectThatIsNotFollowed) {
  const Passing p;
  ClipFrame last = p.frames.back();
  const cv::Rect ball = cv::boundingRect(last.labels), far(ball.x - 20, ball.y, 6, 12);
  const cv::Mat left = cv::Mat::zeros(last.labels.size(), CV_8U);
  left(cv::Rect(ball.x, ball.y, ball.width / 4, ball.height)).setTo(255);
  const cv::Mat missed = left & last.labels;
  last.labels.setTo(0, left);
  last.bgr(far).setTo(cv::Scalar(120, 150, 220));
  const FrameOutput out = p.removed(std::nullopt, last);
  EXPECT_GT(cv::countNonZero(missed), 100);
  EXPECT_GT(psnr(out.bgr, emptyTable(), missed), 35.0);
  EXPECT_EQ(cv::norm(out.bgr(far), last.bgr(far), cv::NORM_INF), 0.0);
}

// A string that neither mask nor model have.
TEST(Renderer, TakesOutWhatHangsOnAnObjectThatIsFollowed) {
  const Passing p;
  ClipFrame last = p.frames.back();
  const cv::Rect ball = cv::boundingRect(last.labels), all({0, 0}, last.labels.size()),
                 string = cv::Rect(ball.x + ball.width / 2, ball.y - 20, 2, 22) & all,
                 other = cv::Rect(ball.x - 20, ball.y - 10, 2, 22) & all;
  cv::Mat hangs = cv::Mat::zeros(last.labels.size(), CV_8U);
  hangs(string).setTo(255, last.labels(string) == 0);
  last.bgr.setTo(cv::Scalar(20, 20, 20), hangs);
  last.bgr(other).setTo(cv::Scalar(20, 20, 20));
  const FrameOutput out = p.removed(Passing::poseAt(Passing::kFrames - 1), last);
  ASSERT_GT(cv::countNonZero(hangs), 20);
  EXPECT_GT(psnr(out.bgr, emptyTable(), hangs), 35.0);
  EXPECT_EQ(cv::norm(out.bgr(other), last.bgr(other), cv::NORM_INF), 0.0) << "it hangs on nothing";
}

// There single pixels tell neither that the place rests nor the shadow's colour.
TEST(Renderer, TakesOutAPassingShadowInGrainyDusk) {
  const Passing p(0.5, 6.0);
  const FrameOutput out = p.removed(Passing::poseAt(Passing::kFrames - 1));
  EXPECT_GT(cv::countNonZero(out.provenance & p.shadow), 0.97 * cv::countNonZero(p.shadow));
}

// Of few frames that show a place some differ by chance: single pixels seem to change.
TEST(Renderer, TakesOutAPassingShadowWherePixelsSeemToChange) {
  Passing p;
  Prepared spotted = *p.prepared;
  spotted.background.spread = spotted.background.spread.clone();
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if ((7 * u + 3 * v) % 11 == 0) spotted.background.spread.at<float>(v, u) = 20.0f;
    }
  }
  p.prepared = std::make_shared<const Prepared>(std::move(spotted));
  const FrameOutput out = p.removed(Passing::poseAt(Passing::kFrames - 1));
  EXPECT_GT(psnr(out.bgr, emptyTable(), p.shadow), 35.0);
}

// Frames that were taken for lit there were not, quite: what is around tells that the place rests.
TEST(Renderer, TakesOutAPassingShadowWhereOthersMakeAPlaceSeemToChange) {
  Passing p;
  Prepared unsettled = *p.prepared;
  const cv::Rect shadow = cv::boundingRect(p.shadow);
  const cv::Rect block((shadow.tl() + shadow.br()) / 2 - cv::Point(10, 10), cv::Size(21, 21));
  ASSERT_GT(cv::countNonZero(p.shadow(block)), block.area() / 2);
  ASSERT_EQ(cv::countNonZero(unsettled.background.shaded_at_times(block)), block.area());
  unsettled.background.spread = unsettled.background.spread.clone();
  unsettled.background.spread(block).setTo(20.0f);
  p.prepared = std::make_shared<const Prepared>(std::move(unsettled));
  const FrameOutput out = p.removed(Passing::poseAt(Passing::kFrames - 1));
  EXPECT_GT(psnr(out.bgr, emptyTable(), p.shadow), 35.0);
}

// Where the object is in the video is not known, its shadow may be any that passes.
TEST(Renderer, TakesOutAllThatPassesOfAnObjectThatIsNotFollowed) {
  const Passing p;
  const FrameOutput out = p.removed(std::nullopt);
  EXPECT_GT(psnr(out.bgr, emptyTable(), p.shadow), 35.0);
  EXPECT_GT(cv::countNonZero(out.provenance(p.cloud)), p.cloud.area() / 2);
}

}  // namespace
}  // namespace calipso::render
