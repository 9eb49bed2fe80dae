#include "calipso_flow/clip_dynamics.hpp"

#include <gtest/gtest.h>

#include "calipso_flow/live_dynamics.hpp"
#include "rendered_scene.hpp"

namespace calipso::flow {
namespace {

constexpr double kFps = 30.0;
constexpr double kNoise = 2.0;  // grey levels
const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

Frame frameOf(double time, const Eigen::Isometry3d& pose, uint64_t seed, double scroll = 0.0,
              double noise = kNoise) {
  const Camera camera = test::testCamera();
  return makeFrame(time, test::render(test::boxModel(), pose, camera, noise, seed, scroll), camera);
}

ClipAnalyser analyserOf(const Frame& key) {
  return ClipAnalyser(key, {test::boxModel()}, {cv::Mat()}, kGravity);
}

// The box's pose after moving with constant velocity and spin about the world's vertical.
Eigen::Isometry3d movedPose(double t, const Eigen::Vector3d& velocity, double spin) {
  Eigen::Isometry3d pose = test::boxModel().world_from_object;
  pose.linear() =
      Eigen::AngleAxisd(spin * t, Eigen::Vector3d::UnitZ()).toRotationMatrix() * pose.linear();
  pose.translation() += velocity * t;
  return pose;
}

TEST(ClipDynamics, findsVelocityAndSpinOfARenderedBox) {
  const Eigen::Vector3d velocity(0.5, 0.0, 0.3);
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.8), 1));
  for (int k = 1; k < 12; ++k) {
    analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.8), 1 + k));
  }
  const ObjectDynamics box = analyser.finish().front();
  ASSERT_EQ(box.motions.size(), 12u);
  EXPECT_TRUE(box.motions[6].moving);
  EXPECT_GT(box.motions[6].tracks, 20);
  // 2 % of the speed; in depth, where a pixel's hundredth is a millimetre, 5 %.
  EXPECT_LT((box.motions[6].state.velocity - velocity).norm(), 0.05 * velocity.norm());
  EXPECT_NEAR(box.motions[6].state.velocity.x(), 0.5, 0.01);
  EXPECT_NEAR(box.motions[6].state.velocity.z(), 0.3, 0.01);
  EXPECT_NEAR(box.motions[6].state.spin.z(), 0.8, 0.08);
}

// 0.5 rad in a frame, while nothing is known of its motion: looks must be turned to find it.
TEST(ClipDynamics, findsAFastSpinningBox) {
  const Eigen::Vector3d velocity(0.5, 0.0, 0.3);
  const double spin = 15.0;
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, spin), 1));
  for (int k = 1; k < 10; ++k)
    analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, spin), 1 + k));
  const ObjectDynamics box = analyser.finish().front();
  for (const ObjectMotion& motion : box.motions) EXPECT_GT(motion.tracks, 6);
  EXPECT_NEAR(box.motions[5].state.spin.z(), spin, 0.03 * spin);
  // Every second frame is the next ones' reference: their errors, some tenths of a pixel of 6.7,
  // add up.
  EXPECT_NEAR(box.motions[5].state.velocity.x(), 0.5, 0.07);
  EXPECT_NEAR(box.motions[5].state.velocity.z(), 0.3, 0.07);
}

// Struck, it turns a radian away from what is expected: what it shows then it showed in earlier frames only.
TEST(ClipDynamics, findsABoxThatABlowTurnsBack) {
  constexpr int kBlow = 8;  // after this frame
  const auto poseAt = [=](int k) {
    const double turn = -4.0 * std::min(k, kBlow) / kFps + 26.0 * std::max(0, k - kBlow) / kFps;
    return movedPose(1.0, 0.3 * k / kFps * Eigen::Vector3d::UnitX(), turn);
  };
  ObjectTracker tracker(test::boxModel(), frameOf(0.0, poseAt(0), 1), {});
  for (int k = 1; k < kBlow + 3; ++k) {
    const Observation observed = tracker.track(frameOf(k / kFps, poseAt(k), 1 + k), false);
    ASSERT_TRUE(observed.found) << "frame " << k;
    EXPECT_LT(observed.world_from_object.linear().col(0).cross(poseAt(k).linear().col(0)).norm(),
              0.05)
        << "frame " << k;
    EXPECT_GT(observed.world_from_object.linear().col(0).dot(poseAt(k).linear().col(0)), 0.0);
  }
}

// In a picture four times as wide 45 px are what 11 are.
TEST(ClipDynamics, looksAsManyTimesFartherInAWiderPicture) {
  Camera camera = test::testCamera();
  camera.width *= 4, camera.height *= 4, camera.fx *= 4, camera.fy *= 4;
  camera.cx = 639.5, camera.cy = 479.5;
  const auto frameAt = [&](int k, double x) {
    const Eigen::Isometry3d pose = movedPose(1.0, {x, 0.0, 0.0}, 0.0);
    return makeFrame(k / kFps, test::render(test::boxModel(), pose, camera, kNoise, 1 + k), camera);
  };
  ObjectTracker tracker(test::boxModel(), frameAt(0, 0.0), {});
  for (int k = 1; k < 3; ++k) ASSERT_TRUE(tracker.track(frameAt(k, 0.0), false).found);
  const Observation struck = tracker.track(frameAt(3, 45.0 * 2.0 / camera.fx), false);
  ASSERT_TRUE(struck.found);
  EXPECT_NEAR(struck.world_from_object.translation().x(), 45.0 * 2.0 / camera.fx, 0.002);
}

// Thrown up, it falls, is not seen while it would fall out of the picture, and then is where it was
// at first.
Observation seenAgainAfterAFall(int unseen, bool cut) {
  constexpr int kFalls = 7;
  const Eigen::Vector3d up(0.0, 0.0, 0.8), away(100.0, 0.0, 0.0);
  TrackerParams params;
  params.gravity = kGravity;
  ObjectTracker tracker(test::boxModel(), frameOf(0.0, movedPose(0.0, away, 0.0), 1), {}, params);
  for (int k = 1; k < kFalls + unseen; ++k) {
    const double t = k / kFps;
    const Eigen::Vector3d way = k < kFalls ? up * t + 0.5 * t * t * kGravity : away;
    EXPECT_EQ(tracker.track(frameOf(t, movedPose(1.0, way, 0.0), 1 + k), false).found, k < kFalls);
  }
  return tracker.track(frameOf((kFalls + unseen) / kFps, movedPose(0.0, away, 0.0), 90), cut);
}

TEST(ClipDynamics, looksAgainForWhatMayHaveLanded) {
  EXPECT_TRUE(seenAgainAfterAFall(15, false).found);
}

TEST(ClipDynamics, noFallGoesOnOverACut) { EXPECT_TRUE(seenAgainAfterAFall(9, true).found); }

// Noise hides tracks from a reference; a new one from the same side would only add its pose's
// error.
TEST(ClipDynamics, noiseWearsNoReferenceOut) {
  constexpr double kHeavy = 30.0;  // grey levels
  const Eigen::Vector3d velocity(0.3, 0.0, 0.0);
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.0), 1, 0.0, kHeavy));
  for (int k = 1; k < 16; ++k) {
    analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.0), 1 + k, 0.0, kHeavy));
  }
  const ObjectDynamics box = analyser.finish().front();
  // One frame's error, not the sum of fifteen.
  const double x = movedPose(15 / kFps, velocity, 0.0).translation().x();
  EXPECT_NEAR(box.observations[15].world_from_object.translation().x(), x, 0.002);
}

// A box with a strong texture is found all the same.
TEST(ClipDynamics, heavyNoiseCostsCertaintyOnly) {
  constexpr double kHeavy = 40.0;  // grey levels
  const Eigen::Vector3d velocity(0.5, 0.0, 0.3);
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.8), 1, 0.0, kHeavy));
  for (int k = 1; k < 12; ++k) {
    analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.8), 1 + k, 0.0, kHeavy));
  }
  const ObjectDynamics box = analyser.finish().front();
  ASSERT_EQ(box.motions.size(), 12u);
  EXPECT_TRUE(box.motions[6].moving);
  EXPECT_NEAR(box.motions[6].state.velocity.x(), 0.5, 0.05);
  EXPECT_NEAR(box.motions[6].state.velocity.z(), 0.3, 0.05);
}

TEST(ClipDynamics, twoFramesAreEnoughForAVelocity) {
  const Eigen::Vector3d velocity(0.5, 0.0, 0.3);
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.0), 1));
  analyser.add(frameOf(1 / kFps, movedPose(1 / kFps, velocity, 0.0), 2));
  const ObjectDynamics box = analyser.finish().front();
  ASSERT_EQ(box.motions.size(), 2u);
  EXPECT_TRUE(box.trajectory.collisions.empty());
  EXPECT_TRUE(box.motions[1].moving);
  // 6.7 px in a frame, found to a few hundredths: 2 %.
  EXPECT_NEAR(box.motions[1].state.velocity.x(), 0.5, 0.03);
  EXPECT_NEAR(box.motions[1].state.velocity.z(), 0.3, 0.03);
}

TEST(ClipDynamics, framesNeedNotBeEvenlySpaced) {
  const Eigen::Vector3d velocity(0.4, 0.0, 0.2);
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.5), 1));
  double time = 0.0;
  for (int k = 1; k < 12; ++k) {
    time += k % 2 ? 1.0 / 60.0 : 1.0 / 20.0;
    analyser.add(frameOf(time, movedPose(time, velocity, 0.5), 1 + k));
  }
  const ObjectDynamics box = analyser.finish().front();
  EXPECT_TRUE(box.trajectory.collisions.empty());
  EXPECT_NEAR(box.motions[6].state.velocity.x(), 0.4, 0.01);
  EXPECT_NEAR(box.motions[6].state.velocity.z(), 0.2, 0.01);
}

TEST(ClipDynamics, keyFrameHasTheAlignedPoseExactly) {
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, {1, 0, 0}, 0.0), 1));
  analyser.add(frameOf(1 / kFps, movedPose(1 / kFps, {1, 0, 0}, 0.0), 2));
  const ObjectDynamics box = analyser.finish().front();
  EXPECT_EQ(box.motions[0].world_from_object.matrix(), test::boxModel().world_from_object.matrix());
}

TEST(ClipDynamics, staticBoxBeforeAMovingBackgroundIsAtRest) {
  const Eigen::Isometry3d pose = test::boxModel().world_from_object;
  ClipAnalyser analyser = analyserOf(frameOf(0.0, pose, 21));
  for (int k = 1; k < 12; ++k) analyser.add(frameOf(k / kFps, pose, 21 + k, 3.0 * k));
  const ObjectDynamics box = analyser.finish().front();
  EXPECT_EQ(box.motions.size(), 12u);
  for (const ObjectMotion& motion : box.motions) {
    EXPECT_FALSE(motion.moving);
    const double deviation =
        std::sqrt(motion.state.twistCovariance().topLeftCorner<3, 3>().trace());
    EXPECT_LT(motion.state.velocity.norm(), deviation);
  }
}

// Few tracks are no sign that it has gone while the picture stays the same, and what starts with
// 10 px a frame is searched for at once.
TEST(ClipDynamics, findsInItsPlaceWhatHasFewTracksUntilItStarts) {
  constexpr int kStart = 8;
  DynamicsParams params;
  params.tracker.seed_count = 8;
  const auto poseAt = [](int k) {
    return movedPose(std::max(0, k - kStart) / kFps, {1.5, 0.0, 0.0}, 0.0);
  };
  ClipAnalyser analyser(frameOf(0.0, poseAt(0), 1), {test::boxModel()}, {cv::Mat()}, kGravity,
                        params);
  for (int k = 1; k < 14; ++k) analyser.add(frameOf(k / kFps, poseAt(k), 1 + k));
  const ObjectDynamics box = analyser.finish().front();
  for (int k = 1; k < 14; ++k) {
    const Observation& seen = box.observations[k];
    ASSERT_TRUE(seen.found) << k;
    // A tenth of a frame's way is half a pixel.
    const double x = (seen.world_from_object.translation() - poseAt(k).translation()).x();
    EXPECT_NEAR(x, 0.0, 0.005) << k;
  }
}

// Not one of its points is followed; that it has not moved is seen all the same, and that it does.
TEST(ClipDynamics, takesWhatCannotBeFollowedToRestWhileItsPictureStays) {
  DynamicsParams params;
  params.tracker.trust.least_correlation = 1.0;  // no patch is good enough
  const Eigen::Isometry3d rest = test::boxModel().world_from_object;
  ClipAnalyser analyser(frameOf(0.0, rest, 1), {test::boxModel()}, {cv::Mat()}, kGravity, params);
  for (int k = 1; k < 8; ++k) analyser.add(frameOf(k / kFps, rest, 1 + k));
  analyser.add(frameOf(8 / kFps, movedPose(0.1, {1.0, 0.0, 0.0}, 0.0), 9));
  const ObjectDynamics box = analyser.finish().front();
  for (int k = 1; k < 8; ++k) {
    EXPECT_TRUE(box.observations[k].found) << k;
    EXPECT_EQ(box.observations[k].world_from_object.matrix(), rest.matrix()) << k;
    EXPECT_GT(box.observations[k].covariance(0, 0), box.observations[0].covariance(0, 0));
  }
  EXPECT_FALSE(box.observations[8].found);
  EXPECT_EQ(summary({box}), "box at rest");
}

TEST(ClipDynamics, cameraMotionIsNotObjectMotion) {
  const ObjectModel model = test::boxModel();
  const auto frameFrom = [&](int k) {
    Camera camera = test::testCamera();
    camera.world_from_camera.translation() += Eigen::Vector3d(0.01 * k, 0.0, 0.004 * k);
    return makeFrame(k / kFps, test::render(model, model.world_from_object, camera, kNoise, 40 + k),
                     camera);
  };
  ClipAnalyser analyser = analyserOf(frameFrom(0));
  for (int k = 1; k < 10; ++k) analyser.add(frameFrom(k));
  EXPECT_FALSE(analyser.finish().front().motions[5].moving);
}

// All that varies in the picture has moved, and yet the place has stayed.
TEST(ClipDynamics, takesAThingBeforeAPlainWallForNoCut) {
  const Camera camera = test::testCamera();
  const auto frame = [&](double time, int x) {
    cv::Mat wall(camera.height, camera.width, CV_8U, cv::Scalar(120));
    wall({x, 80, 60, 60}).setTo(220);
    return makeFrame(time, wall, camera);
  };
  EXPECT_FALSE(isCut(frame(0.0, 40), frame(1 / kFps, 110), DynamicsParams().cut_correlation));
}

// A pan of a third of the picture between two frames, of a camera whose pose is known.
TEST(ClipDynamics, takesAPanForNoCut) {
  const auto frameAt = [](int k, double phase) {
    Camera camera = test::testCamera();
    camera.world_from_camera.rotate(Eigen::AngleAxisd(0.25 * k, Eigen::Vector3d::UnitY()));
    cv::Mat picture(camera.height, camera.width, CV_8U);
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        const Eigen::Vector3d far =
            (camera.world_from_camera.linear() * camera.ray(u, v)).normalized();
        picture.at<uchar>(v, u) =
            static_cast<uchar>(test::textureAt(0.25 * far) / 2 +
                               60 * (1 + std::sin(phase + 17.0 * far.x() + 23.0 * far.z())));
      }
    }
    return makeFrame(k / kFps, picture, camera);
  };
  const double least = DynamicsParams().cut_correlation;
  EXPECT_FALSE(isCut(frameAt(0, 0.0), frameAt(1, 0.0), least));
  EXPECT_TRUE(isCut(frameAt(0, 0.0), frameAt(1, M_PI), least));
}

// The key frame's line of sight, whatever the camera looks at later.
TEST(ClipDynamics, distanceErrsAlongTheKeyFramesSight) {
  const Eigen::Vector3d velocity(0.5, 0.0, 0.3);
  ObjectModel model = test::boxModel();
  model.position_covariance(1, 1) = 0.1 * 0.1;  // m^2, of 2 m
  ClipAnalyser analyser(frameOf(0.0, movedPose(0.0, velocity, 0.0), 1), {model}, {cv::Mat()},
                        kGravity);
  for (int k = 1; k < 8; ++k)
    analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.0), 1 + k));
  Camera aside = test::testCamera();
  aside.world_from_camera =
      Eigen::AngleAxisd(-M_PI_2, Eigen::Vector3d::UnitZ()) * aside.world_from_camera;
  const Eigen::Isometry3d last = movedPose(8 / kFps, velocity, 0.0);
  analyser.add(makeFrame(8 / kFps, test::render(model, last, aside, kNoise, 9), aside));
  const MotionState state = analyser.finish().front().trajectory.states[4];
  // A distance that errs by 5 % is a velocity that does.
  EXPECT_GT(std::sqrt(state.twistCovariance()(0, 0)), 0.05 * 0.45);
}

TEST(ClipDynamics, seesACutAndTakesItForNoMotion) {
  const Eigen::Isometry3d pose = test::boxModel().world_from_object;
  ClipAnalyser analyser = analyserOf(frameOf(0.0, pose, 61));
  for (int k = 1; k < 4; ++k) analyser.add(frameOf(k / kFps, pose, 61 + k));
  const Camera camera = test::testCamera();
  cv::Mat other(camera.height, camera.width, CV_8U);
  cv::RNG rng(5);
  rng.fill(other, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(other, other, {0, 0}, 8.0);
  cv::normalize(other, other, 0, 255, cv::NORM_MINMAX);
  for (int k = 4; k < 7; ++k) analyser.add(makeFrame(k / kFps, other, camera));
  ASSERT_EQ(analyser.cutTimes().size(), 1u);
  EXPECT_NEAR(analyser.cutTimes()[0], 3.5 / kFps, 1e-9);
  const ObjectDynamics box = analyser.finish().front();
  EXPECT_TRUE(box.trajectory.collisions.empty());
  EXPECT_EQ(box.motions[5].tracks, 0);
  EXPECT_FALSE(box.motions[2].moving);
}

TEST(ClipDynamics, objectThatLeavesThePictureLosesItsTracks) {
  const Eigen::Vector3d velocity(3.0, 0.0, 0.0);
  ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.0), 80));
  for (int k = 1; k < 30; ++k) {
    analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.0), 80 + k));
  }
  const ObjectDynamics box = analyser.finish().front();
  EXPECT_GT(box.motions[2].tracks, 0);
  EXPECT_EQ(box.motions[15].tracks, 0);
  EXPECT_NEAR(box.motions[15].state.velocity.x(), 3.0, 0.15);
  EXPECT_EQ(summary({box}).rfind("box moves, seen in ", 0), 0u) << summary({box});
}

TEST(ClipDynamics, objectWithoutTextureHasNoEstimate) {
  const Camera camera = test::testCamera();
  const cv::Mat flat(camera.height, camera.width, CV_8U, cv::Scalar(128));
  ClipAnalyser analyser = analyserOf(makeFrame(0.0, flat, camera));
  for (int k = 1; k < 3; ++k) analyser.add(makeFrame(k / kFps, flat, camera));
  const ObjectDynamics box = analyser.finish().front();
  EXPECT_EQ(box.motions[1].tracks, 0);
  EXPECT_FALSE(box.motions[1].moving);
  EXPECT_EQ(summary({box}), "box not followed: seen in 1 of 3 frames");
}

TEST(ClipDynamics, refusesStampsThatDoNotIncrease) {
  const Frame key = frameOf(0.1, test::boxModel().world_from_object, 90);
  ClipAnalyser analyser = analyserOf(key);
  for (double time : {0.1, 0.05}) {
    Frame frame = key;
    frame.time = time;
    try {
      analyser.add(frame);
      FAIL() << "a frame at " << time << " s was accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("order of time"), std::string::npos);
    }
  }
  EXPECT_EQ(analyser.frameCount(), 1);
}

TEST(ClipDynamics, repeatsToTheByte) {
  const Eigen::Vector3d velocity(0.4, 0.1, -0.2);
  const auto run = [&] {
    ClipAnalyser analyser = analyserOf(frameOf(0.0, movedPose(0.0, velocity, 0.5), 1));
    for (int k = 1; k < 6; ++k) {
      analyser.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.5), 1 + k));
    }
    return analyser.finish().front().motions.back().state;
  };
  const MotionState a = run(), b = run();
  EXPECT_EQ(a.velocity, b.velocity);
  EXPECT_EQ(a.covariance, b.covariance);
}

TEST(LiveDynamics, followsARenderedBoxCausally) {
  const Eigen::Vector3d velocity(0.6, 0.0, 0.2);
  LiveAnalyser live(frameOf(0.0, movedPose(0.0, velocity, 0.0), 1), {test::boxModel()}, {cv::Mat()},
                    kGravity);
  std::vector<NamedMotion> motions;
  for (int k = 1; k < 15; ++k) {
    motions = live.add(frameOf(k / kFps, movedPose(k / kFps, velocity, 0.0), 1 + k));
  }
  ASSERT_EQ(motions.size(), 1u);
  EXPECT_TRUE(motions[0].motion.moving);
  EXPECT_LT((motions[0].motion.state.velocity - velocity).norm(), 0.1 * velocity.norm());
}

}  // namespace
}  // namespace calipso::flow
