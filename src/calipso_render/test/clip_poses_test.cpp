#include "calipso_render/clip_poses.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kStart(0.0, 0.1, 0.12), kEnd(0.15, 0.1, 0.12);

ClipSample rollingBall() {
  ClipSample clip;
  for (int k = 0; k < 3; ++k) {
    ClipFrame frame = frameWithBall(ballAt(kStart + 0.5 * k * (kEnd - kStart)));
    frame.stamp_ns = 1000 + k;
    clip.add(frame);
  }
  return clip;
}

ObjectPose poseAt(const Eigen::Vector3d& centre) {
  return {kBallLabel, ballAt(centre).world_from_object};
}

TEST(TakePoses, AcceptsWhatFitsTheMaskAtItsStamp) {
  ClipSample clip = rollingBall();
  const PosesTaken taken = takePoses(
      {{1001, {poseAt(0.5 * (kStart + kEnd))}}, {1002, {poseAt(kStart)}}, {5, {poseAt(kStart)}}},
      {ballAt(kStart)}, clip);
  EXPECT_EQ(taken.offered, 2);
  EXPECT_EQ(taken.accepted, 1);
  EXPECT_GT(taken.worst_accepted_overlap, 0.97);
  EXPECT_TRUE(clip.frames()[0].poses.empty());
  ASSERT_EQ(clip.frames()[1].poses.size(), 1u);
  EXPECT_TRUE(clip.frames()[2].poses.empty());  // the ball is not where it was at the start
}

// Masks of a lattice fill its gaps and miss members: if it rests throughout, less has to fit.
TEST(TakePoses, OfWhatRestsThroughoutMasksMayMissParts) {
  ClipSample clip;
  PosesByStamp at_rest, leaving;
  for (int k = 0; k < 3; ++k) {
    ClipFrame frame = frameWithBall(ballAt(kStart));
    frame.stamp_ns = 1000 + k;
    const cv::Rect box = cv::boundingRect(frame.labels);
    if (k > 0) frame.labels(cv::Rect(box.x, box.y, box.width, box.height / 5)).setTo(0);
    clip.add(frame);
    at_rest[frame.stamp_ns] = {poseAt(kStart)};
    leaving[frame.stamp_ns] = {poseAt(k < 2 ? kStart : kEnd)};
  }
  EXPECT_EQ(takePoses(at_rest, {ballAt(kStart)}, clip).accepted, 3);
  EXPECT_EQ(takePoses(leaving, {ballAt(kStart)}, clip).accepted, 1);
}

TEST(TakePoses, WhatStandsBeforeTheObjectDoesNotCount) {
  ClipSample whole = rollingBall(), hidden;
  for (ClipFrame frame : whole.frames()) {
    const cv::Rect box = cv::boundingRect(frame.labels);
    cv::Mat half = frame.labels(cv::Rect(box.x, box.y, box.width, box.height / 2));
    half.setTo(kBallLabel + 1);  // another object before its upper half
    hidden.add(frame);
  }
  EXPECT_EQ(takePoses({{1002, {poseAt(kEnd)}}}, {ballAt(kStart)}, hidden).accepted, 1);
}

// It is then known to be nowhere, and others' frames count.
TEST(TakePoses, AcceptsThatAnObjectHasLeftThePicture) {
  ClipSample clip = rollingBall();
  clip.setLabels(1002, cv::Mat::zeros(kHeight, kWidth, CV_8U));
  const Eigen::Vector3d beside(5.0, 0.1, 0.12);
  EXPECT_EQ(takePoses({{1002, {poseAt(beside)}}}, {ballAt(kStart)}, clip).accepted, 1);
  EXPECT_EQ(takePoses({{1002, {poseAt(kEnd)}}}, {ballAt(kStart)}, clip).accepted, 0);
}

TEST(AnyMoves, TellsRestFromMotion) {
  ClipSample resting;
  for (int k = 0; k < 3; ++k) resting.add(frameWithBall(ballAt(kStart)));
  EXPECT_FALSE(anyMoves(resting, {ballAt(kStart)}));
  EXPECT_TRUE(anyMoves(rollingBall(), {ballAt(kStart)}));
}

TEST(AnyMoves, WhatPassesBeforeAnObjectDoesNotMoveIt) {
  ClipSample passed;
  passed.add(frameWithBall(ballAt(kStart)));
  ClipFrame frame = frameWithBall(ballAt(kStart));
  const cv::Rect box = cv::boundingRect(frame.labels);
  frame.labels(cv::Rect(box.x, box.y, box.width / 2, box.height)).setTo(kBallLabel + 1);
  passed.add(frame);
  EXPECT_FALSE(anyMoves(passed, {ballAt(kStart)}));
}

// The ball as a camera `right` m beside the key frame's sees it.
ClipFrame seenFrom(double right, const Eigen::Vector3d& centre) {
  ClipFrame frame = frameWithBall(ballAt(centre - Eigen::Vector3d(right, 0, 0)));
  frame.camera.world_from_camera.translation().x() += right;
  return frame;
}

TEST(AnyMoves, ACameraThatMovesDoesNotMoveTheObject) {
  ClipSample shaken, followed;
  for (const double right : {0.0, 0.03, -0.05})
    shaken.add(seenFrom(right, kStart)),
        followed.add(seenFrom(right, kStart + Eigen::Vector3d(right, 0, 0)));
  EXPECT_FALSE(anyMoves(shaken, {ballAt(kStart)}));
  EXPECT_TRUE(anyMoves(followed, {ballAt(kStart)}));  // its masks are all the same
}

// Poses that were taken make further frames count.
TEST(Prepare, UsesTheFramesWhosePosesAreKnown) {
  ClipSample clip = rollingBall();
  RenderParams params;
  params.planes = table();
  const Prepared without = prepare(clip, {ballAt(kStart)}, params);
  EXPECT_EQ(without.light_views, 1);
  EXPECT_EQ(without.texture_views, 1);
  takePoses({{1001, {poseAt(0.5 * (kStart + kEnd))}}, {1002, {poseAt(kEnd)}}}, {ballAt(kStart)},
            clip);
  const Prepared with = prepare(clip, {ballAt(kStart)}, params);
  EXPECT_EQ(with.light_views, 3);
  EXPECT_EQ(with.texture_views, 3);
}

// A camera that moves shows other sides of what rests.
TEST(Prepare, UsesTheFramesOfAMovingCamera) {
  RenderParams params;
  params.planes = table();
  ClipSample clip;
  for (const double right : {0.0, 0.06, -0.06}) {
    ClipFrame frame = seenFrom(right, kStart);
    frame.stamp_ns = 1000 + static_cast<int>(100 * right);
    clip.add(frame);
  }
  const Prepared prepared = prepare(clip, {ballAt(kStart)}, params);
  ASSERT_FALSE(prepared.moves[0]);
  EXPECT_EQ(prepared.texture_views, 3);
  View key{prepared.key_picture, prepared.key_labels, prepared.camera, {}}, other = key;
  other.camera = clip.frames()[1].camera;
  EXPECT_EQ(shownAnew({key, key}, {false}), std::vector<bool>{false});
  EXPECT_EQ(shownAnew({key, other}, {false}), std::vector<bool>{true});
}

}  // namespace
}  // namespace calipso::render
