#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/Edit.h>
#include <calipso_msgs/EditReport.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Plan.h>
#include <calipso_msgs/SimulationState.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <visualization_msgs/MarkerArray.h>

#include <functional>
#include <set>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"
#include "world_fixtures.hpp"

namespace calipso::fem {
namespace {

constexpr int kFrames = 6;
const Eigen::Vector3d kStart(0.0, 0.0, 1.0);

// Plays player, alignment, user and a flow that fails, for one box in the air.
class SimulatorNodeTest : public ::testing::Test {
 protected:
  SimulatorNodeTest() {
    info_ = nh_.advertise<calipso_msgs::ClipInfo>(topics::kClipInfo, 1, true);
    models_ = nh_.advertise<calipso_msgs::AlignedModels>(topics::kModels, 1, true);
    status_ = nh_.advertise<calipso_msgs::NodeStatus>(topics::kStatus, 10);
    camera_ = nh_.advertise<sensor_msgs::CameraInfo>(topics::kCameraInfo, 10);
    edits_ = nh_.advertise<calipso_msgs::Edit>(topics::kEdits, 10);
    listen(topics::kState, states_);
    listen(topics::kEditsApplied, reports_);
    listen(topics::kPlan, plans_);
    listen(topics::kStatus, statuses_);
    listen(topics::kMarkers, markers_);
  }

  template <typename Message>
  void listen(const std::string& topic, std::vector<Message>& into) {
    subscribers_.push_back(nh_.subscribe<Message>(
        topic, 100, [&into](const boost::shared_ptr<const Message>& m) { into.push_back(*m); }));
  }

  static bool waitFor(const std::function<bool()>& condition, double seconds = 60.0) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
    while (ros::ok() && !condition() && ros::WallTime::now() < end)
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.02));
    return condition();
  }

  static ros::Time stamp(int k) { return ros::Time(100, 0) + ros::Duration(k / 30.0); }

  bool connected() const {
    return camera_.getNumSubscribers() > 0 && edits_.getNumSubscribers() > 0 &&
           status_.getNumSubscribers() > 1 && subscribers_.front().getNumPublishers() > 0 &&
           subscribers_[1].getNumPublishers() > 0 && subscribers_.back().getNumPublishers() > 0;
  }

  void sendClip() {
    calipso_msgs::ClipInfo info;
    info.header.stamp = stamp(0);
    info.frames = kFrames;
    info.fps = 30.0;
    info.last_stamp = stamp(kFrames - 1);
    info_.publish(info);
    sendModels(kStart);
  }

  void sendModels(const Eigen::Vector3d& start) {
    calipso_msgs::AlignedModels models;
    models.header.stamp = stamp(0);
    models.models.resize(1);
    models.models[0].object = "thing";
    models.models[0].index = 1;
    models.models[0].mesh = calipso::toMsg(test::boxSurface({0.1, 0.1, 0.1}, 2));
    models.models[0].world_from_object.pose =
        calipso::toMsg(Eigen::Isometry3d(Eigen::Translation3d(start)));
    models_.publish(models);
  }

  void sayThatFlowFailed() {
    calipso_msgs::NodeStatus failed;
    failed.node = "flow";
    failed.state = calipso_msgs::NodeStatus::FAILED;
    failed.message = "its process ended";
    status_.publish(failed);
  }

  calipso_msgs::NodeStatus own() const {  // the simulator's last
    calipso_msgs::NodeStatus last;
    for (const auto& status : statuses_)
      if (status.node == "simulator") last = status;
    return last;
  }

  void sendFrame(int k) {
    sensor_msgs::CameraInfo info;
    info.header.stamp = stamp(k);
    camera_.publish(info);
  }

  // Edits that no frame will come for do not wait without a word.
  void expectRefused(calipso_msgs::Edit late) {
    late.header.stamp = stamp(1000);
    edits_.publish(late);
    calipso_msgs::Edit slow;
    slow.kind = calipso_msgs::Edit::TIME_SCALE;
    slow.factor = 0.5;
    edits_.publish(slow);
    ASSERT_TRUE(waitFor([&] { return reports_.size() == 4; }));
    EXPECT_NE(reports_[2].message.find("the video ends at"), std::string::npos);
    EXPECT_NE(reports_[3].message.find("laid out"), std::string::npos);
    for (int k : {2, 3}) {
      EXPECT_FALSE(reports_[k].accepted);
      EXPECT_EQ(reports_[k].header.stamp, stamp(2 * (kFrames - 1)));
    }
  }

  ros::NodeHandle nh_;
  ros::Publisher info_, models_, status_, camera_, edits_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<calipso_msgs::SimulationState> states_;
  std::vector<calipso_msgs::EditReport> reports_;
  std::vector<calipso_msgs::Plan> plans_;
  std::vector<calipso_msgs::NodeStatus> statuses_;
  std::vector<visualization_msgs::MarkerArray> markers_;
};

TEST_F(SimulatorNodeTest, OneStatePerFrameAndEditsAreReported) {
  ASSERT_TRUE(waitFor([&] { return connected(); }));
  calipso_msgs::Edit heavier;  // comes before the clip, and is kept
  heavier.header.stamp = stamp(0);
  heavier.object = "thing";
  heavier.kind = calipso_msgs::Edit::GRAVITY;
  heavier.mode = calipso_msgs::Edit::FACTOR;
  heavier.factor = 3.0;
  edits_.publish(heavier);
  calipso_msgs::Edit bad = heavier;
  bad.object = "teapot";
  edits_.publish(bad);
  ASSERT_TRUE(waitFor([&] { return own().edits == 2; }));
  sendClip();
  ASSERT_TRUE(waitFor([&] { return own().state == calipso_msgs::NodeStatus::PREPARING; }))
      << own().message;
  sayThatFlowFailed();
  ASSERT_TRUE(waitFor([&] { return own().state == calipso_msgs::NodeStatus::READY; }))
      << own().message;

  for (int k = 0; k < kFrames; ++k) sendFrame(k);
  ASSERT_TRUE(waitFor([&] { return states_.size() == kFrames && reports_.size() == 2; }));
  for (int k = 0; k < kFrames; ++k) EXPECT_EQ(states_[k].header.stamp, stamp(k));

  EXPECT_TRUE(reports_[0].accepted) << reports_[0].message;
  EXPECT_FALSE(reports_[1].accepted);
  EXPECT_NE(reports_[1].message.find("teapot"), std::string::npos);

  // Afloat, then three times its weight: it falls with 2 g.
  const auto& object = states_.back().objects.at(0);
  EXPECT_EQ(object.kind, "rigid");
  EXPECT_TRUE(object.edited);
  const double t = (kFrames - 1) / 30.0;
  EXPECT_NEAR(object.pose.position.z, kStart.z() - 9.81 * t * t, 1e-6);
  EXPECT_EQ(object.vertices.size(), 3u * 26u);

  ASSERT_TRUE(
      waitFor([&] { return !plans_.empty() && plans_.back().objects.at(0).kind == "rigid"; }));
  ASSERT_TRUE(waitFor([&] { return !markers_.empty(); }));
  std::set<std::string> namespaces;
  for (const auto& marker : markers_.back().markers) namespaces.insert(marker.ns);
  EXPECT_TRUE(namespaces.count("surface"));
  EXPECT_TRUE(namespaces.count("support"));

  // Models that come anew, as the user has corrected a pose, make a world that begins there and then
  // and in which the edits hold.
  const Eigen::Vector3d corrected = kStart + Eigen::Vector3d(0.5, 0.0, 0.0);
  sendModels(corrected);
  ASSERT_TRUE(waitFor([&] {
    sendFrame(kFrames - 1);
    return states_.back().objects.at(0).pose.position.x > kStart.x() + 0.25;
  }));
  EXPECT_TRUE(states_.back().objects.at(0).edited);
  sendFrame(2 * (kFrames - 1));
  ASSERT_TRUE(waitFor([&] { return states_.back().header.stamp == stamp(2 * (kFrames - 1)); }));
  EXPECT_NEAR(states_.back().objects.at(0).pose.position.z, corrected.z() - 9.81 * t * t, 1e-6);
  EXPECT_EQ(reports_.size(), 2u) << "what was reported is reported again";
  expectRefused(heavier);
}

}  // namespace
}  // namespace calipso::fem

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "simulator_node_rostest");
  return RUN_ALL_TESTS();
}
