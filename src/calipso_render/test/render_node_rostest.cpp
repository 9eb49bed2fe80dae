#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Segmentation.h>
#include <calipso_msgs/SimulationState.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <algorithm>
#include <functional>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"
#include "conversions.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kCentre(0.0, 0.1, 0.12);
constexpr int kClipFrames = 3;

// Plays the other nodes' part for a clip of one ball.
class RenderNodeTest : public ::testing::Test {
 protected:
  // @param step the ball's way from frame to frame
  explicit RenderNodeTest(const std::string& space = "",
                          const Eigen::Vector3d& step = Eigen::Vector3d::Zero())
      : nh_(space), step_(step) {
    namespace t = topics;
    info_ = nh_.advertise<calipso_msgs::ClipInfo>(t::kClipInfo, 1, true);
    clip_ = nh_.advertise<sensor_msgs::Image>(t::kClipImage, 10);
    clip_camera_ = nh_.advertise<sensor_msgs::CameraInfo>(t::kClipCameraInfo, 10);
    segmentation_ = nh_.advertise<calipso_msgs::Segmentation>(t::kSegmentation, 10);
    models_ = nh_.advertise<calipso_msgs::AlignedModels>(t::kModels, 1, true);
    image_ = nh_.advertise<sensor_msgs::Image>(t::kImage, 10);
    camera_ = nh_.advertise<sensor_msgs::CameraInfo>(t::kCameraInfo, 10);
    state_ = nh_.advertise<calipso_msgs::SimulationState>(t::kState, 10);
    edited_sub_ = nh_.subscribe<sensor_msgs::Image>(
        t::kImageEdited, 10,
        [this](const sensor_msgs::ImageConstPtr& m) { edited_.push_back(*m); });
    provenance_sub_ = nh_.subscribe<sensor_msgs::Image>(
        t::kProvenance, 10,
        [this](const sensor_msgs::ImageConstPtr& m) { provenance_.push_back(*m); });
    status_sub_ = nh_.subscribe<calipso_msgs::NodeStatus>(
        t::kStatus, 10, [this](const calipso_msgs::NodeStatusConstPtr& m) {
          if (m->node == "render") status_ = *m;
        });
    sendCameraPose();
  }

  static bool waitFor(const std::function<bool()>& condition, double seconds = 60.0) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
    while (ros::ok() && !condition() && ros::WallTime::now() < end)
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.02));
    return condition();
  }

  static ros::Time stamp(int k) { return ros::Time(100, 0) + ros::Duration(k / 30.0); }

  static std_msgs::Header header(int k) {
    std_msgs::Header h;
    h.stamp = stamp(k);
    h.frame_id = "camera_optical_frame";
    return h;
  }

  void sendCameraPose() {
    geometry_msgs::TransformStamped t;
    t.header.stamp = stamp(0);
    t.header.frame_id = topics::kWorldFrame;
    t.child_frame_id = header(0).frame_id;
    t.transform = toTransformMsg(camera().world_from_camera);
    tf_.sendTransform(t);
  }

  sensor_msgs::CameraInfo cameraInfo(int k) const {
    sensor_msgs::CameraInfo info = toMsg(camera());
    info.header = header(k);
    return info;
  }

  ClipFrame frame(int k) const { return frameWithBall(ballAt(kCentre + k * step_)); }
  sensor_msgs::Image picture(int k) const { return imageMsg(header(k), frame(k).bgr); }

  void sendClip() {
    calipso_msgs::ClipInfo info;
    info.header = header(0);
    info.frames = kClipFrames;
    info.fps = 30.0;
    info.last_stamp = stamp(kClipFrames - 1);
    info_.publish(info);
    for (int k = 0; k < kClipFrames; ++k) {
      clip_.publish(picture(k));
      clip_camera_.publish(cameraInfo(k));
      sendLabels(k);
    }
    sendModels();
  }

  void sendLabels(int k) {
    calipso_msgs::Segmentation s;
    s.header = header(k);
    s.labels = imageMsg(header(k), frame(k).labels);
    segmentation_.publish(s);
  }

  // @param key the frame that they are fitted to
  void sendModels(int key = 0) {
    calipso_msgs::AlignedModels models;
    models.header = header(key);
    models.models.resize(1);
    models.models[0].object = "ball";
    models.models[0].index = kBallLabel;
    models.models[0].mesh = toMsg(ball());
    models.models[0].world_from_object.pose = toMsg(ballAt(kCentre).world_from_object);
    models_.publish(models);
  }

  calipso_msgs::SimulationState state(int k, bool edited) const {
    calipso_msgs::SimulationState s;
    s.header = header(k);
    s.objects.resize(1);
    s.objects[0].object = "ball";
    s.objects[0].index = kBallLabel;
    s.objects[0].edited = edited;
    s.objects[0].pose = toMsg(ballAt(kCentre).world_from_object);
    const TriangleMesh mesh = ball();
    for (int i = 0; edited && i < mesh.vertexCount(); ++i) {
      const Eigen::Vector3d p = mesh.vertex(i) + kCentre + Eigen::Vector3d(0.2, 0, 0);
      for (int c = 0; c < 3; ++c) s.objects[0].vertices.push_back(static_cast<float>(p[c]));
    }
    return s;
  }

  void sendFrame(const sensor_msgs::Image& image, int k) {
    image_.publish(image);
    camera_.publish(cameraInfo(k));
  }

  ros::NodeHandle nh_;
  tf2_ros::StaticTransformBroadcaster tf_;
  ros::Publisher info_, clip_, clip_camera_, segmentation_, models_, image_, camera_, state_;
  ros::Subscriber edited_sub_, provenance_sub_, status_sub_;
  std::vector<sensor_msgs::Image> edited_, provenance_;
  calipso_msgs::NodeStatus status_;
  const Eigen::Vector3d step_;
};

// The ball rolls, and somebody follows it.
class RenderNodeWithMotionTest : public RenderNodeTest {
 protected:
  RenderNodeWithMotionTest() : RenderNodeTest("moving", {0.08, 0.0, 0.0}) {
    flow_status_ = nh_.advertise<calipso_msgs::NodeStatus>(topics::kStatus, 10);
    dynamics_ = nh_.advertise<calipso_msgs::ClipDynamics>(topics::kClipDynamics, 1, true);
  }

  void sendFlowStatus(int state) {
    calipso_msgs::NodeStatus status;
    status.node = "flow", status.state = static_cast<std::uint8_t>(state);
    flow_status_.publish(status);
  }

  // The last frame's pose is wrong.
  calipso_msgs::ClipDynamics dynamics() const {
    calipso_msgs::ClipDynamics all;
    for (int k = 0; k < kClipFrames; ++k) {
      calipso_msgs::Dynamics d;
      d.header = header(k);
      d.objects.resize(1);
      d.objects[0].object = "ball", d.objects[0].tracks = 20, d.objects[0].moving = true;
      d.objects[0].world_from_object =
          toMsg(ballAt(kCentre + (k == kClipFrames - 1 ? 0 : k) * step_).world_from_object);
      all.frames.push_back(d);
    }
    return all;
  }

  ros::Publisher flow_status_, dynamics_;
};

TEST_F(RenderNodeWithMotionTest, LearnsFromFramesWhosePosesFit) {
  ASSERT_TRUE(waitFor([&] {
    return clip_.getNumSubscribers() > 0 && clip_camera_.getNumSubscribers() > 0 &&
           segmentation_.getNumSubscribers() > 0 && flow_status_.getNumSubscribers() > 1 &&
           dynamics_.getNumSubscribers() > 0;
  }));
  sendFlowStatus(calipso_msgs::NodeStatus::PREPARING);
  sendClip();
  ASSERT_TRUE(waitFor([&] {
    return status_.message.find("motion in the clip") != std::string::npos;
  })) << status_.message;
  dynamics_.publish(dynamics());
  ASSERT_TRUE(waitFor([&] { return status_.state == calipso_msgs::NodeStatus::READY; }))
      << status_.message;
  EXPECT_NE(status_.message.find("2 for the light, 2 for textures"), std::string::npos)
      << status_.message;
  EXPECT_NE(status_.message.find("2 of 3 poses"), std::string::npos) << status_.message;
}

// Of a live video nothing is lost while the simulator gets ready, however long that takes.
class LiveRenderNodeTest : public RenderNodeTest {
 protected:
  LiveRenderNodeTest() : RenderNodeTest("live") {
    simulator_status_ = nh_.advertise<calipso_msgs::NodeStatus>(topics::kStatus, 10);
  }

  void sendSimulatorStatus(int state) {
    calipso_msgs::NodeStatus status;
    status.node = "simulator", status.state = static_cast<std::uint8_t>(state);
    simulator_status_.publish(status);
  }

  bool isConnected() {
    return waitFor([&] {
      return image_.getNumSubscribers() > 0 && camera_.getNumSubscribers() > 0 &&
             segmentation_.getNumSubscribers() > 0 && models_.getNumSubscribers() > 0 &&
             state_.getNumSubscribers() > 0 && simulator_status_.getNumSubscribers() > 1 &&
             edited_sub_.getNumPublishers() > 0;
    });
  }

  bool isReady() {
    return waitFor([&] { return status_.state == calipso_msgs::NodeStatus::READY; });
  }

  // Whether `count` frames have come back in a while.
  bool haveCome(std::size_t count) {
    return waitFor([&] { return edited_.size() >= count; }, 20.0);
  }

  ros::Publisher simulator_status_;
};

TEST_F(LiveRenderNodeTest, FramesPassUntilTheSimulatorIsReady) {
  ASSERT_TRUE(isConnected());
  sendSimulatorStatus(calipso_msgs::NodeStatus::STARTING);
  sendFrame(picture(0), 0);
  ASSERT_TRUE(haveCome(1));
  sendLabels(0);
  sendModels();
  ASSERT_TRUE(isReady()) << status_.message;
  constexpr int kFrames = 6;
  for (int k = 1; k < kFrames; ++k) {
    sendFrame(picture(k), k);
    ASSERT_TRUE(haveCome(k + 1)) << k;
    EXPECT_EQ(edited_[k].data, picture(k).data);
  }

  sendSimulatorStatus(calipso_msgs::NodeStatus::READY);
  // Status and frames come by connections of their own: frames may still overtake it.
  bool edited = false;
  for (int k = kFrames; !edited && k < kFrames + 60; ++k) {
    sendFrame(picture(k), k);
    state_.publish(state(k, true));
    sendLabels(k);
    ASSERT_TRUE(haveCome(k + 1)) << k;
    edited = edited_[k].data != picture(k).data;
  }
  EXPECT_TRUE(edited);
}

TEST_F(LiveRenderNodeTest, WhatHasNoStampPasses) {
  std::string said;
  const auto diagnostics = nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
      topics::kDiagnostics, 10,
      [&](const diagnostic_msgs::DiagnosticArrayConstPtr& m) { said += m->status[0].message; });
  ASSERT_TRUE(waitFor([&] {
    return image_.getNumSubscribers() > 0 && edited_sub_.getNumPublishers() > 0 &&
           diagnostics.getNumPublishers() > 0;
  }));
  sensor_msgs::Image image = picture(0);
  image.header.stamp = ros::Time(0);
  for (std::size_t k = 1; k < 3; ++k) {
    image_.publish(image);
    ASSERT_TRUE(haveCome(k));
    EXPECT_EQ(edited_.back().data, image.data);
  }
  EXPECT_TRUE(waitFor([&] { return said.find("stamp is 0") != std::string::npos; })) << said;
}

// Many frames come while the first one is segmented and its models are fitted: it stays the key
// frame. Then every frame waits for its own mask.
TEST_F(LiveRenderNodeTest, TheKeyFrameIsKeptAndFramesWaitForTheirMasks) {
  ASSERT_TRUE(isConnected());
  sendSimulatorStatus(calipso_msgs::NodeStatus::READY);
  // Before all that other tests send: the video starts over.
  constexpr int kFirst = -600, kMeanwhile = kFirst + 15;  // more than may wait
  for (int k = kFirst; k < kMeanwhile; ++k) {
    sendFrame(picture(k), k);
    ASSERT_TRUE(haveCome(k - kFirst + 1)) << k;
  }
  sendLabels(kFirst);
  sendModels(kFirst);
  ASSERT_TRUE(isReady()) << status_.message;

  const std::size_t before = edited_.size();
  sendFrame(picture(kMeanwhile), kMeanwhile);
  state_.publish(state(kMeanwhile, true));
  EXPECT_FALSE(waitFor([&] { return edited_.size() > before; }, 1.0));
  sendLabels(kMeanwhile);
  ASSERT_TRUE(haveCome(before + 1));
  EXPECT_NE(edited_.back().data, picture(kMeanwhile).data);
  // A mask that does not come holds up the video no longer than the queue is long.
  for (int k = kMeanwhile + 1; k <= kMeanwhile + 10; ++k) {
    sendFrame(picture(k), k);
    state_.publish(state(k, true));
    waitFor([] { return false; }, 0.05);
  }
  EXPECT_TRUE(haveCome(before + 2));
}

TEST_F(RenderNodeTest, PreparesAndEditsInOrder) {
  ASSERT_TRUE(waitFor([&] {
    return image_.getNumSubscribers() > 0 && clip_.getNumSubscribers() > 0 &&
           clip_camera_.getNumSubscribers() > 0 && segmentation_.getNumSubscribers() > 0 &&
           state_.getNumSubscribers() > 0 && edited_sub_.getNumPublishers() > 0 &&
           provenance_sub_.getNumPublishers() > 0;
  }));
  sendClip();
  ASSERT_TRUE(waitFor([&] { return status_.state == calipso_msgs::NodeStatus::READY; }))
      << status_.message;
  EXPECT_EQ(status_.clip_frames, static_cast<unsigned>(kClipFrames));

  // The later frame's state comes first: nothing may overtake.
  sendFrame(picture(0), 0);
  sendFrame(picture(1), 1);
  sensor_msgs::Image deep = picture(2);
  deep.encoding = "mono16", deep.step = deep.width * 2, deep.data.resize(deep.step * deep.height);
  sendFrame(deep, 2);
  state_.publish(state(1, true));
  state_.publish(state(2, true));
  state_.publish(state(0, false));
  ASSERT_TRUE(waitFor([&] { return edited_.size() == 3 && provenance_.size() == 3; }))
      << edited_.size();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(edited_[k].header.stamp, stamp(k));

  EXPECT_EQ(edited_[0].data, picture(0).data);
  EXPECT_NE(edited_[1].data, picture(1).data);
  EXPECT_EQ(edited_[2].data, deep.data);  // cannot be edited: passes as it came
  const auto changed = [&](int k) {
    return std::count_if(provenance_[k].data.begin(), provenance_[k].data.end(),
                         [](int p) { return p != 0; });
  };
  EXPECT_EQ(changed(0), 0);
  EXPECT_GT(changed(1), 1000);  // the ball covers about 1900 px
  EXPECT_EQ(changed(2), 0);
}

TEST(Conversions, PosesAtRestAreTheKeyFrames) {
  calipso_msgs::ClipDynamics clip;
  clip.frames.resize(2);
  for (int k = 0; k < 2; ++k) {
    calipso_msgs::ObjectDynamics ball;
    ball.object = "ball", ball.tracks = 9;
    ball.world_from_object.position.x = 0.01 * k;
    ball.world_from_object.orientation.w = 1.0;
    clip.frames[k].header.stamp = ros::Time(1 + k);
    clip.frames[k].objects.push_back(ball);
  }
  const std::vector<ObjectModel> models = {ballAt(kCentre)};
  const auto poseAt = [&](int k) {
    return posesFromMsg(clip, models).at((1 + k) * 1000000000ll).front().world_from_object;
  };
  EXPECT_TRUE(poseAt(1).isApprox(models.front().world_from_object));
  clip.frames[1].objects.front().moving = true;
  EXPECT_DOUBLE_EQ(poseAt(1).translation().x(), 0.01);
}

}  // namespace
}  // namespace calipso::render

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "render_node_rostest");
  return RUN_ALL_TESTS();
}
