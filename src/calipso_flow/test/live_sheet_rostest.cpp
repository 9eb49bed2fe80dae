#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/Dynamics.h>
#include <calipso_msgs/Edit.h>
#include <calipso_msgs/EditReport.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Segmentation.h>
#include <calipso_msgs/SimulationState.h>
#include <cv_bridge/cv_bridge.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <map>
#include <stdexcept>

#include "../tools/film.hpp"
#include "calipso_flow/surface_view.hpp"
#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"
#include "node_test_frames.hpp"

// Shows flow and simulator, live, the film of a sheet that a wind blows away from where it hung; in
// the midst of it the sheet is made deformable, and has to go on as it was seen to.
namespace calipso::flow {
namespace {

constexpr int kFrames = 24, kEdited = 16;

class LiveSheetTest : public testing::Test {
 protected:
  LiveSheetTest() : sheet_(filmedSheet({0.0, 4.0, 0.0}, kFrames + 1)) {}

  void SetUp() override {
    geometry_msgs::TransformStamped tf;
    tf.header.frame_id = topics::kWorldFrame;
    tf.child_frame_id = kCameraFrame;
    tf.transform = toTransformMsg(sheet_.camera.world_from_camera);
    broadcaster_.sendTransform(tf);
    subscribers_ = {
        nh_.subscribe<calipso_msgs::NodeStatus>(
            topics::kStatus, 100, [this](const auto& msg) { status_[msg->node] = *msg; }),
        nh_.subscribe<calipso_msgs::ClipDynamics>(topics::kClipDynamics, 10,
                                                  [this](const auto& msg) { clip_ = *msg; }),
        nh_.subscribe<calipso_msgs::Dynamics>(
            topics::kDynamics, 100, [this](const auto& msg) { dynamics_.push_back(*msg); }),
        nh_.subscribe<calipso_msgs::SimulationState>(
            topics::kState, 100, [this](const auto& msg) { states_.push_back(*msg); }),
        nh_.subscribe<calipso_msgs::EditReport>(
            topics::kEditsApplied, 10, [this](const auto& msg) { reports_.push_back(*msg); })};
    image_ = nh_.advertise<sensor_msgs::Image>(topics::kImage, 100);
    info_ = nh_.advertise<sensor_msgs::CameraInfo>(topics::kCameraInfo, 100);
    labels_ = nh_.advertise<calipso_msgs::Segmentation>(topics::kSegmentation, 1, true);
    aligned_ = nh_.advertise<calipso_msgs::AlignedModels>(topics::kModels, 1, true);
    edits_ = nh_.advertise<calipso_msgs::Edit>(topics::kEdits, 10);
  }

  bool ready(const std::string& node) {
    return status_[node].state == calipso_msgs::NodeStatus::READY;
  }

  void send(int k) const {
    sensor_msgs::CameraInfo camera = toMsg(sheet_.camera);
    camera.header = headerOf(k);
    info_.publish(camera);
    const cv::Mat picture = film(sheet_.model, sheet_.shapes[k], sheet_.camera, 2.0, k + 1);
    image_.publish(cv_bridge::CvImage(headerOf(k), "mono8", picture).toImageMsg());
  }

  void sendSegmentation(int k) {
    calipso_msgs::Segmentation segmentation;
    segmentation.header = headerOf(k);
    cv::Mat labels(sheet_.camera.height, sheet_.camera.width, CV_8U, cv::Scalar(0));
    const SurfaceView view =
        viewSurface(sheet_.model.mesh, sheet_.camera,
                    sheet_.camera.world_from_camera.inverse() * sheet_.model.world_from_object);
    labels(view.window).setTo(1, view.depth > 0.0f);
    cv_bridge::CvImage(headerOf(k), "mono8", labels).toImageMsg(segmentation.labels);
    // By which the key frame's is told from later ones.
    segmentation.contours.resize(k == 0 ? 2 : 0);
    labels_.publish(segmentation);
  }

  void sendModels() {
    calipso_msgs::AlignedModels models;
    models.header = headerOf(0);
    models.header.frame_id = topics::kWorldFrame;
    calipso_msgs::AlignedModel model;
    model.object = "sheet";
    model.index = 1;
    model.world_from_object.pose = calipso::toMsg(sheet_.model.world_from_object);
    model.mesh = model.cad = calipso::toMsg(sheet_.model.mesh);
    model.trusted = true;
    models.models.push_back(model);
    aligned_.publish(models);
  }

  void sendKey() {
    send(0);
    sendSegmentation(0);
    sendModels();
  }

  void sendEdit(int k) const {
    calipso_msgs::Edit edit;
    edit.header = headerOf(k);
    edit.object = "sheet";
    edit.kind = calipso_msgs::Edit::KIND;
    edit.value = "deformable";
    edits_.publish(edit);
  }

  // Of the surface at frame k, as the flow hands them over: 3 #V, object axes, which are the world's.
  Eigen::VectorXd measuredVelocities(int k) const {
    const auto& velocities = dynamics_[k - 1].objects.at(0).mode_velocities;
    const auto& modes = clip_.objects.at(0).modes;
    Eigen::VectorXd field = Eigen::VectorXd::Zero(3 * sheet_.model.mesh.vertexCount());
    for (size_t m = 0; m < velocities.size(); ++m) {
      const std::vector<float>& shape = modes.at(m).displacements;
      field += velocities[m] *
               Eigen::Map<const Eigen::VectorXf>(shape.data(), shape.size()).cast<double>();
    }
    return field;
  }

  Eigen::VectorXd trueVelocities(int k) const {
    const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> v =
        0.5 * kFps * (sheet_.shapes[k + 1] - sheet_.shapes[k - 1]);
    return Eigen::Map<const Eigen::VectorXd>(v.data(), v.size());
  }

  const calipso_msgs::ObjectState& stateAt(int k) const {
    for (const calipso_msgs::SimulationState& state : states_) {
      if (state.header.stamp == headerOf(k).stamp) return state.objects.at(0);
    }
    throw std::out_of_range("no state of frame " + std::to_string(k));
  }

  Eigen::VectorXd simulated(int k) const {
    const std::vector<float>& v = stateAt(k).vertices;
    return Eigen::Map<const Eigen::VectorXf>(v.data(), v.size()).cast<double>();
  }

  FilmedSheet sheet_;
  ros::NodeHandle nh_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  std::vector<ros::Subscriber> subscribers_;
  ros::Publisher image_, info_, labels_, aligned_, edits_;
  std::map<std::string, calipso_msgs::NodeStatus> status_;
  calipso_msgs::ClipDynamics clip_;
  std::vector<calipso_msgs::Dynamics> dynamics_;
  std::vector<calipso_msgs::SimulationState> states_;
  std::vector<calipso_msgs::EditReport> reports_;
};

TEST_F(LiveSheetTest, goesOnAsItWasSeenTo) {
  ASSERT_TRUE(waitFor([&] {
    return image_.getNumSubscribers() > 0 && info_.getNumSubscribers() > 1 &&
           edits_.getNumSubscribers() > 0;
  })) << "the nodes did not come up";
  sendKey();
  ASSERT_TRUE(waitFor([&] { return ready("flow") && ready("simulator"); }))
      << status_["flow"].message << "; " << status_["simulator"].message;
  const size_t before = states_.size();
  for (int k = 1; k < kFrames; ++k) {
    if (k == kEdited) sendEdit(k);
    if (k == kEdited) {
      ASSERT_TRUE(waitFor([&] { return status_["simulator"].edits > 0; }));
    }
    send(k);
    ASSERT_TRUE(waitFor([&] {
      return dynamics_.size() == size_t(k) && states_.size() == before + k;
    })) << "frame "
        << k;
    EXPECT_EQ(dynamics_.back().header.stamp, headerOf(k).stamp);
    EXPECT_EQ(states_.back().header.stamp, headerOf(k).stamp);
  }

  ASSERT_FALSE(clip_.objects.empty());
  const Eigen::VectorXd seen = measuredVelocities(kEdited), real = trueVelocities(kEdited);
  EXPECT_LT((seen - real).norm(), 0.3 * real.norm());

  ASSERT_EQ(reports_.size(), 1u);
  EXPECT_TRUE(reports_[0].accepted) << reports_[0].message;
  EXPECT_FALSE(stateAt(kEdited - 1).edited);
  ASSERT_TRUE(stateAt(kEdited).edited);
  // It sets out with what was seen; no wind blows on it, gravity brakes it: the more the later.
  const Eigen::VectorXd first = kFps * (simulated(kEdited + 1) - simulated(kEdited));
  EXPECT_GT(first.dot(seen), 0.7 * seen.squaredNorm());

  // Corrected models: motion is followed anew, from a frame in which they are segmented.
  sheet_.model.world_from_object.translation().x() += 0.001;
  sendModels();
  ASSERT_TRUE(waitFor([&] { return !ready("flow"); }));
  send(kFrames);
  EXPECT_TRUE(waitFor([&] {
    sendSegmentation(kFrames);  // perhaps before the frame
    return ready("flow");
  })) << status_["flow"].message;
}

}  // namespace
}  // namespace calipso::flow

int main(int argc, char** argv) {
  ros::init(argc, argv, "live_sheet_rostest");
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
