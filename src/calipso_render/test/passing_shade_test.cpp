#include "place/passing_shade.hpp"

#include <gtest/gtest.h>

#include "ball_setting.hpp"
#include "place/unseen_casters.hpp"

namespace calipso::render {
namespace {

using namespace testing;

constexpr float kUmbra = 0.5f;  // what is left of the table's codes in the ball's shadow

// Is a point of the table in the shadow of the ball?
bool isInShadow(const Eigen::Vector3f& p, const Eigen::Vector3d& centre) {
  const Eigen::Vector3f l = sunlight().direction, way = centre.cast<float>() - p;
  const float along = way.dot(l);
  return along > 0.0f && (way - along * l).norm() < static_cast<float>(kBallRadius);
}

struct Clip {
  std::vector<ClipFrame> frames;
  std::vector<Surface> surfaces;
  ReceiverOf receiver = [](int u, int v) { return receiverAt(table(), camera(), u, v); };
};

// The ball, shadow and all, at one place per frame.
Clip ballAlong(const std::vector<Eigen::Vector3d>& places) {
  Clip clip;
  clip.surfaces.push_back(makeSurface(ballAt(places.front())));
  for (const Eigen::Vector3d& centre : places) {
    ClipFrame f = frameWithBall(ballAt(centre));
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto r = clip.receiver(u, v);
        if (f.labels.at<std::uint8_t>(v, u) != 0 || !r || !isInShadow(r->position, centre))
          continue;
        for (int c = 0; c < 3; ++c)
          f.bgr.at<cv::Vec3b>(v, u)[c] =
              static_cast<std::uint8_t>(kUmbra * f.bgr.at<cv::Vec3b>(v, u)[c]);
      }
    }
    ObjectPose pose{kBallLabel};
    pose.world_from_object.translation() = centre;
    f.poses = {pose};
    clip.frames.push_back(f);
  }
  return clip;
}

PassingCast castOf(const Clip& clip, const std::vector<bool>& moves) {
  return {clip.surfaces, moves, sunlight().direction.cast<double>(), 0.004,
          Eigen::Vector3d::UnitZ()};
}

const Eigen::Vector3d kFrom(-0.25, 0.1, 0.2), kTo(0.05, 0.1, 0.2);

TEST(PassingShade, IsTakenOffWhereItLiesInAllFramesButOne) {
  std::vector<Eigen::Vector3d> places(10, kTo);
  places[0] = kFrom;
  const Clip clip = ballAlong(places);
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  const cv::Mat before = b.plate.clone();
  const ShadeThatStays stays =
      leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b);
  int shaded = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = clip.receiver(u, v);
      const bool seen_lit =
          clip.frames[0].labels.at<std::uint8_t>(v, u) == 0 && r && !isInShadow(r->position, kFrom);
      // The place is seen past the ball and its mask's margin in all frames.
      if (!seen_lit || !isInShadow(r->position, kTo) || b.count.at<std::uint8_t>(v, u) < 10 ||
          stays.never_lit.at<std::uint8_t>(v, u) != 0)
        continue;
      ++shaded;
      EXPECT_NEAR(b.plate.at<cv::Vec3f>(v, u)[2], tableColour(u, v)[2], 0.5f) << u << " " << v;
      EXPECT_LT(before.at<cv::Vec3f>(v, u)[2], 0.7f * tableColour(u, v)[2]);  // by majority
    }
  }
  EXPECT_GT(shaded, 100);
}

// Up to 7 px beside the predicted shadow a frame may show it or not.
TEST(PassingShade, IsTakenOffWhereTheOneLitFrameShowsItBesideThePlace) {
  std::vector<Eigen::Vector3d> places(6, kTo);
  places[0] = kTo + Eigen::Vector3d(0.03, 0.0, 0.0);
  const Clip clip = ballAlong(places);
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b);
  int came_to_light = 0, dark = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = clip.receiver(u, v);
      if (!r || b.count.at<std::uint8_t>(v, u) < 6 || !isInShadow(r->position, kTo) ||
          isInShadow(r->position, places[0]))
        continue;
      ++came_to_light;
      dark += b.plate.at<cv::Vec3f>(v, u)[2] < tableColour(u, v)[2] - 0.5f;
    }
  }
  EXPECT_GT(came_to_light, 50);
  EXPECT_LT(4 * dark, came_to_light);  // shade is predicted once for 2 x 2 pixels
}

// A band of the table lies in the shade of something else, where the ball's darkens nothing.
TEST(PassingShade, TellsWhereThePlaceHasNoSunAnyhow) {
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 12; ++i) places.push_back(kFrom + i / 11.0 * (kTo - kFrom));
  Clip clip = ballAlong(places);
  const int middle = kWidth / 4;
  for (ClipFrame& f : clip.frames) {
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < middle; ++u) {
        if (f.labels.at<std::uint8_t>(v, u) == 0)
          f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b(kUmbra * tableColour(u, v));
      }
    }
  }
  BackgroundParams params;
  params.shadow_margin_px = 2;  // the ball is small
  Background b = seenBackground(clip.frames, true);
  const std::vector<bool> moves = {true};
  const ShadeThatStays stays =
      leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, params, b);
  const auto count = [&](const cv::Range& columns, std::uint8_t what) {
    return cv::countNonZero(stays.told.colRange(columns) == what);
  };
  EXPECT_GT(count({0, middle}, kNoSun), 20);
  EXPECT_EQ(count({0, middle}, kSun), 0);
  EXPECT_GT(count({middle, kWidth}, kSun), 20);
  EXPECT_EQ(count({middle, kWidth}, kNoSun), 0);
}

TEST(PassingShade, StaysWhereNoFrameShowsThePlaceWithoutIt) {
  const Clip clip = ballAlong({kTo, kTo + Eigen::Vector3d(0.01, 0.0, 0.0), kTo});
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  const ShadeThatStays stays =
      leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b);
  int dark = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (b.plate.at<cv::Vec3f>(v, u)[2] > 0.6f * tableColour(u, v)[2] ||
          b.count.at<std::uint8_t>(v, u) == 0)
        continue;
      ++dark;
      EXPECT_EQ(stays.never_lit.at<std::uint8_t>(v, u), 255) << u << " " << v;
    }
  }
  EXPECT_GT(dark, 100);
  EXPECT_EQ(stays.sun.at<float>(5, 5), 1.0f);
}

// Where all frames are in shade by the prediction, one of them (by its rim, or by the sky's alone)
// shows more light than the others.
TEST(PassingShade, LeavesTheLeastOfItWhereItLiesInAllFrames) {
  std::vector<Eigen::Vector3d> places(6, kTo);
  places[0] = kFrom;
  Clip clip = ballAlong(places);
  clip.frames[0].poses = clip.frames[1].poses;
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  const ShadeThatStays stays =
      leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b);
  int shaded = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = clip.receiver(u, v);
      if (!r || b.count.at<std::uint8_t>(v, u) < 6 || !isInShadow(r->position, kTo) ||
          isInShadow(r->position, kFrom))
        continue;
      ++shaded;
      EXPECT_EQ(stays.never_lit.at<std::uint8_t>(v, u), 255);
      EXPECT_NEAR(b.plate.at<cv::Vec3f>(v, u)[2], tableColour(u, v)[2], 0.5f) << u << " " << v;
    }
  }
  EXPECT_GT(shaded, 100);
}

// What lies beside a place takes some of its sky: less than a pixel's values tell from their noise.
TEST(PassingShade, IsTakenOffWhereItIsFaint) {
  const Eigen::Vector3d rests(0.05, 0.1, kBallRadius), flies(-0.4, 0.1, 0.3);
  std::vector<Eigen::Vector3d> places(10, rests);
  for (int i = 0; i < 3; ++i) places[i] = flies;
  Clip clip = ballAlong(places);
  const auto isDimmed = [&](int u, int v) {
    const auto r = clip.receiver(u, v);
    return r &&
           (r->position.head<2>() - rests.cast<float>().head<2>()).norm() < 1.5 * kBallRadius &&
           !isInShadow(r->position, rests);
  };
  for (std::size_t i = 3; i < places.size(); ++i) {
    ClipFrame& f = clip.frames[i];
    for (int v = 0; v < kHeight; ++v)
      for (int u = 0; u < kWidth; ++u)
        if (isDimmed(u, v) && f.labels.at<std::uint8_t>(v, u) == 0)
          f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3f(f.bgr.at<cv::Vec3b>(v, u)) * 0.95f;
  }
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b);
  int dimmed = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (!isDimmed(u, v) || b.count.at<std::uint8_t>(v, u) < 10) continue;
      ++dimmed;
      EXPECT_NEAR(b.plate.at<cv::Vec3f>(v, u)[2], tableColour(u, v)[2], 1.0f) << u << " " << v;
    }
  }
  EXPECT_GT(dimmed, 100);
}

TEST(PassingShade, ChangesNothingWhereThePredictedShadowIsNotSeen) {
  std::vector<Eigen::Vector3d> places(6, kTo);
  places[0] = kFrom;
  Clip clip = ballAlong(places);
  for (std::size_t i = 0; i < places.size(); ++i) {  // an overcast day
    const ClipFrame sunless = frameWithBall(ballAt(places[i]));
    clip.frames[i].bgr = sunless.bgr;
  }
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  const cv::Mat before = b.plate.clone();
  leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b);
  EXPECT_EQ(cv::norm(b.plate, before, cv::NORM_INF), 0.0);
}

TEST(PassingShade, NothingIsToldWithoutPoses) {
  Clip clip = ballAlong({kFrom, kTo, kTo});
  for (ClipFrame& f : clip.frames) f.poses.clear();
  const std::vector<bool> moves = {true};
  Background b = seenBackground(clip.frames, true);
  EXPECT_TRUE(leaveOutPassingShade(clip.frames, castOf(clip, moves), clip.receiver, {}, b)
                  .never_lit.empty());
  EXPECT_TRUE(b.shaded_at_times.empty());
}

// What deforms has no poses: the key frame's shadow is known alone. Where the plate is as dark it is
// taken out, where other frames show it lit it is seen.
TEST(PassingShade, OfWhatIsNotFollowedIsTakenOutWhereThePlateHasItToo) {
  Clip clip = ballAlong({kTo, kTo + Eigen::Vector3d(0.02, 0.0, 0.0), kTo});
  ClipSample sample;
  for (ClipFrame& f : clip.frames) f.poses.clear(), sample.add(f);
  const Prepared prepared = prepare(sample, {ballAt(kTo)}, params());
  ASSERT_TRUE(prepared.moves[0]);
  int shaded = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = clip.receiver(u, v);
      if (!r || clip.frames[0].labels.at<std::uint8_t>(v, u) != 0 || !isInShadow(r->position, kTo))
        continue;
      ++shaded;
      // The shadow leaves half of the codes; what is filled differs from the table by its pattern.
      EXPECT_GT(prepared.background.plate.at<cv::Vec3f>(v, u)[2], 0.7f * tableColour(u, v)[2])
          << u << " " << v;
    }
  }
  EXPECT_GT(shaded, 100);
}

// Beside something that rests, too: later frames show the place that what is not followed has left.
TEST(PassingShade, OfWhatIsNotFollowedLeavesThePlaceThatLaterFramesShowLit) {
  const Eigen::Vector3d resting(0.25, 0.1, 0.1);
  const ObjectModel other = ballAt(resting, "other", 2);
  Clip clip = ballAlong({kTo, kFrom, kFrom, kFrom});
  const ClipFrame rests = frameWithBall(other);
  ClipSample sample;
  for (ClipFrame& f : clip.frames) {
    rests.bgr.copyTo(f.bgr, rests.labels == 2), rests.labels.copyTo(f.labels, rests.labels == 2);
    f.poses.clear(), sample.add(f);
  }
  const Prepared prepared = prepare(sample, {ballAt(kTo), other}, params());
  ASSERT_TRUE(prepared.moves[0] && !prepared.moves[1]);
  int shaded = 0, invented = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = clip.receiver(u, v);
      if (!r || clip.frames[0].labels.at<std::uint8_t>(v, u) != 0 ||
          clip.frames[1].labels.at<std::uint8_t>(v, u) != 0 || !isInShadow(r->position, kTo) ||
          isInShadow(r->position, resting) || isInShadow(r->position, kFrom))
        continue;
      ++shaded, invented += prepared.background.invented.at<std::uint8_t>(v, u) != 0 ? 1 : 0;
    }
  }
  EXPECT_GT(shaded, 100);
  EXPECT_LT(invented, shaded / 4);  // what is left lies at its edges
}

}  // namespace
}  // namespace calipso::render
