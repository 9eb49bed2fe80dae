#include "calipso_bag/preparation.hpp"

#include <gtest/gtest.h>

using calipso::bag::NodeStanding;
using calipso::bag::NodeState;
using calipso::bag::Preparation;

namespace {

NodeStanding at(NodeState state, int clip_frames = 0) { return {state, "", clip_frames, 0}; }

const std::vector<std::string> kAll = {"segmentation", "align",  "flow",
                                       "simulator",    "render", "recorder"};

}  // namespace

TEST(Preparation, WaitsForSegmentationAndAlignAtTheKeyFrame) {
  Preparation preparation;
  preparation.update("segmentation", at(NodeState::kReady));
  preparation.update("align", at(NodeState::kPreparing));
  EXPECT_FALSE(preparation.keyFrameSettled());
  preparation.update("align", at(NodeState::kReady));
  EXPECT_TRUE(preparation.keyFrameSettled());
  EXPECT_FALSE(preparation.allSettled());
}

TEST(Preparation, IsSettledWhenEveryNodeIsReady) {
  Preparation preparation;
  for (const auto& node : kAll) {
    EXPECT_FALSE(preparation.allSettled()) << "before " << node;
    preparation.update(node, at(NodeState::kReady));
  }
  EXPECT_TRUE(preparation.allSettled());
  EXPECT_TRUE(preparation.unsettled().empty());
}

TEST(Preparation, TheSlowestLivingConsumerCounts) {
  Preparation preparation;
  preparation.update("segmentation", at(NodeState::kPreparing, 5));
  preparation.update("flow", at(NodeState::kPreparing, 2));
  preparation.update("render", at(NodeState::kPreparing, 4));
  EXPECT_EQ(preparation.clipFramesTaken(6), 2);
  preparation.fail("flow", "its process ended");
  EXPECT_EQ(preparation.clipFramesTaken(6), 4);
}

TEST(Preparation, ARecorderThatTakesPartCounts) {
  Preparation preparation;
  EXPECT_EQ(preparation.framesRecorded(5), 5);
  preparation.update("recorder", at(NodeState::kReady, 3));
  EXPECT_EQ(preparation.framesRecorded(5), 3);
  preparation.fail("recorder", "its process ended");
  EXPECT_EQ(preparation.framesRecorded(5), 5);
}

TEST(Preparation, NobodyWaitsForAFailedNode) {
  Preparation preparation;
  preparation.update("segmentation", at(NodeState::kReady));
  preparation.fail("align", "no contour");
  EXPECT_TRUE(preparation.keyFrameSettled());
  EXPECT_TRUE(preparation.hopeless());
  EXPECT_TRUE(preparation.allSettled()) << "without models there is nothing more to prepare";
  EXPECT_EQ(preparation.failed(), std::vector<std::string>{"align"});
}

TEST(Preparation, WithoutASegmentationNobodyWaitsForTheAlignment) {
  Preparation preparation;
  preparation.update("align", at(NodeState::kStarting));
  preparation.update("segmentation", at(NodeState::kFailed));
  EXPECT_TRUE(preparation.keyFrameSettled());
}

TEST(Preparation, AFailedNodeStaysFailed) {
  Preparation preparation;
  preparation.fail("flow", "its process ended");
  preparation.update("flow", at(NodeState::kReady));
  EXPECT_EQ(preparation.standing("flow").state, NodeState::kFailed);
  EXPECT_EQ(preparation.standing("flow").message, "its process ended");
}

// The last words of a process can arrive after the news of its end.
TEST(Preparation, TellsASuccessorFromLastWords) {
  constexpr std::int64_t kEnd = 5'000'000'000, kOneMs = 1'000'000;
  Preparation preparation;
  EXPECT_FALSE(preparation.ended("flow"));
  EXPECT_FALSE(preparation.saidBySuccessor("flow", kEnd));
  preparation.end("flow", kEnd);
  EXPECT_TRUE(preparation.ended("flow"));
  EXPECT_FALSE(preparation.saidBySuccessor("flow", kEnd - kOneMs));
  EXPECT_TRUE(preparation.saidBySuccessor("flow", kEnd + kOneMs));
  preparation.end("flow", kEnd + 2 * kOneMs);  // its successor's
  EXPECT_TRUE(preparation.saidBySuccessor("flow", kEnd + kOneMs));
  EXPECT_FALSE(preparation.saidBySuccessor("align", kEnd + kOneMs));
}

TEST(Preparation, IgnoresStrangers) {
  Preparation preparation;
  preparation.fail("somebody", "else");
  EXPECT_TRUE(preparation.failed().empty());
}
