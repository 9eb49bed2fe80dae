#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Segmentation.h>
#include <cv_bridge/cv_bridge.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"
#include "node_test_frames.hpp"
#include "rendered_scene.hpp"

// Shows the node a clip of six frames whose frames come before the models, in the order that suits
// it least, then the same frames once more for editing.
namespace calipso::flow {
namespace {

constexpr int kFrames = 6;
const Eigen::Vector3d kVelocity(0.5, 0.0, 0.3);

class FlowNodeTest : public testing::Test {
 protected:
  void SetUp() override {
    camera_ = test::testCamera();
    model_ = test::boxModel();
    geometry_msgs::TransformStamped tf;
    tf.header.frame_id = topics::kWorldFrame;
    tf.child_frame_id = kCameraFrame;
    tf.transform = toTransformMsg(camera_.world_from_camera);
    broadcaster_.sendTransform(tf);
    subscribers_ = {
        nh_.subscribe<calipso_msgs::NodeStatus>(topics::kStatus, 100,
                                                [this](const auto& msg) { status_ = *msg; }),
        nh_.subscribe<calipso_msgs::ClipDynamics>(topics::kClipDynamics, 1,
                                                  [this](const auto& msg) { clip_ = *msg; }),
        nh_.subscribe<calipso_msgs::Dynamics>(
            topics::kDynamics, 100, [this](const auto& msg) { dynamics_.push_back(*msg); }),
        nh_.subscribe<sensor_msgs::Image>(topics::kFlow, 100,
                                          [this](const auto& msg) { flows_.push_back(*msg); }),
        nh_.subscribe<visualization_msgs::MarkerArray>(
            "flow/markers", 100, [this](const auto& msg) { markers_ = *msg; }),
        nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 100, [this](const auto& msg) { diagnostics_.push_back(*msg); })};
  }

  // What the node publishes for nobody, it does not compute.
  bool hearsTheNode() const {
    return std::all_of(subscribers_.begin(), subscribers_.end(),
                       [](const ros::Subscriber& s) { return s.getNumPublishers() > 0; });
  }

  sensor_msgs::ImagePtr imageOf(int k) const {
    Eigen::Isometry3d pose = model_.world_from_object;
    pose.translation() += kVelocity * (k / kFps);
    return cv_bridge::CvImage(headerOf(k), "mono8", test::render(model_, pose, camera_, 2.0, 1 + k))
        .toImageMsg();
  }

  void send(ros::Publisher& image, ros::Publisher& info, int k) const {
    sensor_msgs::CameraInfo camera = toMsg(camera_);
    camera.header = headerOf(k);
    info.publish(camera);
    image.publish(imageOf(k));
  }

  calipso_msgs::AlignedModels models() const {
    calipso_msgs::AlignedModels msg;
    msg.header = headerOf(0);
    msg.header.frame_id = topics::kWorldFrame;
    calipso_msgs::AlignedModel box;
    box.object = "box";
    box.index = 1;
    box.world_from_object.pose = calipso::toMsg(model_.world_from_object);
    box.mesh = box.cad = calipso::toMsg(model_.mesh);
    box.trusted = true;
    msg.models.push_back(box);
    return msg;
  }

  calipso_msgs::Segmentation segmentation() const {
    calipso_msgs::Segmentation msg;
    msg.contours.resize(1);  // as the key frame has them
    msg.header = headerOf(0);
    cv::Mat labels(camera_.height, camera_.width, CV_8U, cv::Scalar(0));
    const SurfaceView view = viewSurface(
        model_.mesh, camera_, camera_.world_from_camera.inverse() * model_.world_from_object);
    labels(view.window).setTo(1, view.depth > 0.0f);
    cv_bridge::CvImage(headerOf(0), "mono8", labels).toImageMsg(msg.labels);
    msg.contours.emplace_back();  // by which the key frame's is told from those that follow
    return msg;
  }

  // Every frame, every object, the key pose, and the speed the box was given.
  void checkClip() const {
    ASSERT_EQ(clip_.frames.size(), unsigned(kFrames));
    EXPECT_EQ(clip_.header.frame_id, topics::kWorldFrame);
    for (int k = 0; k < kFrames; ++k) {
      EXPECT_EQ(clip_.frames[k].header.stamp, headerOf(k).stamp);
      ASSERT_EQ(clip_.frames[k].objects.size(), 2u);
      EXPECT_EQ(clip_.frames[k].objects[1].object, "unseen");
      EXPECT_EQ(clip_.frames[k].objects[1].tracks, 0u);
    }
    const calipso_msgs::ObjectDynamics& first = clip_.frames[0].objects[0];
    EXPECT_TRUE(fromMsg(first.world_from_object).isApprox(model_.world_from_object, 1e-12));
    EXPECT_TRUE(first.moving);
    // Six frames of a 100 px box: a few per cent.
    EXPECT_NEAR(first.twist.twist.linear.x, kVelocity.x(), 0.05);
    EXPECT_NEAR(first.twist.twist.linear.z, kVelocity.z(), 0.05);
    ASSERT_EQ(clip_.objects.size(), 1u);
    EXPECT_EQ(clip_.objects[0].object, "box");
    EXPECT_TRUE(clip_.objects[0].collisions.empty());
    EXPECT_TRUE(clip_.cuts.empty());
  }

  // What rviz draws, and takes away: no impact is told.
  void checkMarkers() const {
    ASSERT_FALSE(markers_.markers.empty());
    bool taken_away = false;
    for (const visualization_msgs::Marker& m : markers_.markers) {
      const bool is_list = m.type == visualization_msgs::Marker::SPHERE_LIST ||
                           m.type == visualization_msgs::Marker::LINE_STRIP;
      const bool shows_points = is_list && m.action == visualization_msgs::Marker::ADD;
      EXPECT_FALSE(shows_points && m.points.empty()) << m.ns;
      taken_away |= m.ns == "box/collisions" && m.action == visualization_msgs::Marker::DELETE;
    }
    EXPECT_TRUE(taken_away);
  }

  ros::NodeHandle nh_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  std::vector<ros::Subscriber> subscribers_;
  Camera camera_;
  ObjectModel model_;
  calipso_msgs::NodeStatus status_;
  calipso_msgs::ClipDynamics clip_;
  std::vector<calipso_msgs::Dynamics> dynamics_;
  std::vector<sensor_msgs::Image> flows_;
  visualization_msgs::MarkerArray markers_;  // the last
  std::vector<diagnostic_msgs::DiagnosticArray> diagnostics_;
};

TEST_F(FlowNodeTest, analysesTheClipAndRepeatsItPerFrame) {
  ros::Publisher clip_image = nh_.advertise<sensor_msgs::Image>(topics::kClipImage, 100);
  ros::Publisher clip_info = nh_.advertise<sensor_msgs::CameraInfo>(topics::kClipCameraInfo, 100);
  ros::Publisher image = nh_.advertise<sensor_msgs::Image>(topics::kImage, 100);
  ros::Publisher info = nh_.advertise<sensor_msgs::CameraInfo>(topics::kCameraInfo, 100);
  ros::Publisher clip = nh_.advertise<calipso_msgs::ClipInfo>(topics::kClipInfo, 1, true);
  ros::Publisher labels = nh_.advertise<calipso_msgs::Segmentation>(topics::kSegmentation, 1, true);
  ros::Publisher aligned = nh_.advertise<calipso_msgs::AlignedModels>(topics::kModels, 1, true);
  ASSERT_TRUE(waitFor([&] {
    return clip_image.getNumSubscribers() > 0 && clip_info.getNumSubscribers() > 0 &&
           image.getNumSubscribers() > 0 && info.getNumSubscribers() > 0 && hearsTheNode();
  })) << "the node did not come up";

  calipso_msgs::ClipInfo clip_msg;
  clip_msg.header = headerOf(0);
  clip_msg.frames = kFrames;
  clip_msg.fps = kFps;
  clip_msg.last_stamp = headerOf(kFrames - 1).stamp;
  clip.publish(clip_msg);
  for (int k = 0; k < kFrames; ++k) send(clip_image, clip_info, k);
  ASSERT_TRUE(waitFor([&] { return status_.clip_frames == unsigned(kFrames); }));
  labels.publish(segmentation());
  aligned.publish(models());
  ASSERT_TRUE(waitFor([&] {
    return status_.state == calipso_msgs::NodeStatus::READY && !clip_.frames.empty();
  })) << status_.message;
  checkClip();

  for (int k = 0; k < kFrames; ++k) send(image, info, k);
  ASSERT_TRUE(waitFor([&] { return dynamics_.size() == kFrames && flows_.size() == kFrames; }));
  for (int k = 0; k < kFrames; ++k) {
    EXPECT_EQ(dynamics_[k].header.stamp, headerOf(k).stamp);
    EXPECT_EQ(flows_[k].header.stamp, headerOf(k).stamp);
    EXPECT_EQ(flows_[k].encoding, "32FC2");
    EXPECT_EQ(dynamics_[k].objects[0].twist.twist.linear.x,
              clip_.frames[k].objects[0].twist.twist.linear.x);
  }
  ASSERT_TRUE(waitFor([&] { return !markers_.markers.empty(); }));
  checkMarkers();

  diagnostics_.clear();
  model_.world_from_object.translation().x() += 0.01;
  aligned.publish(models());
  EXPECT_TRUE(waitFor([&] {
    return std::any_of(diagnostics_.begin(), diagnostics_.end(), [](const auto& d) {
      return d.status.at(0).message.find("corrected") != std::string::npos;
    });
  })) << "nothing was said of the corrected models";
}

}  // namespace
}  // namespace calipso::flow

int main(int argc, char** argv) {
  ros::init(argc, argv, "flow_node_rostest");
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
