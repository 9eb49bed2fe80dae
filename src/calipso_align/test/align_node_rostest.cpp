// Feeds the align node a key frame's contour and looks at the models that come out.
#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/Segmentation.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <functional>
#include <vector>

#include "calipso_ros/topics.hpp"

namespace calipso::align {
namespace {

constexpr double kTimeoutSec = 40.0;
const ros::Time kStamp(2.5);

// The outline of the scene's double pyramid, moved by a few pixels and a tenth larger.
calipso_msgs::Segmentation keyFrame() {
  calipso_msgs::Contour loop;
  constexpr double kRadius = 33.0, kU = 82.0, kV = 58.0;
  constexpr int kPerSide = 40;
  const double corner_u[] = {1, 0, -1, 0}, corner_v[] = {0, 1, 0, -1};
  for (int side = 0; side < 4; ++side) {
    for (int k = 0; k < kPerSide; ++k) {
      const double t = static_cast<double>(k) / kPerSide;
      const int next = (side + 1) % 4;
      loop.u.push_back(kU + kRadius * ((1 - t) * corner_u[side] + t * corner_u[next]));
      loop.v.push_back(kV + kRadius * ((1 - t) * corner_v[side] + t * corner_v[next]));
      loop.known.push_back(true);
      loop.confidence.push_back(1.0f);
    }
  }
  calipso_msgs::Segmentation msg;
  msg.header.stamp = kStamp;
  msg.contours.resize(1);
  msg.contours[0].object = "disc";
  msg.contours[0].index = 1;
  msg.contours[0].loops.push_back(loop);
  return msg;
}

class AlignNode : public ::testing::Test {
 protected:
  AlignNode()
      : segmentations_(nh_.advertise<calipso_msgs::Segmentation>(topics::kSegmentation, 1)),
        poses_(nh_.advertise<geometry_msgs::PoseStamped>("align/initial_pose/disc", 1)),
        models_(nh_.subscribe(topics::kModels, 0, &AlignNode::onModels, this)) {}

  void onModels(const calipso_msgs::AlignedModelsConstPtr& msg) { received_.push_back(msg); }

  // Spins until `done`, or fails after the timeout.
  void waitFor(const std::function<bool()>& done, const char* what) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kTimeoutSec);
    while (!done()) {
      ASSERT_LT(ros::WallTime::now(), end) << "gave up waiting for " << what;
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
    }
  }

  ros::NodeHandle nh_;
  ros::Publisher segmentations_, poses_;
  ros::Subscriber models_;
  std::vector<calipso_msgs::AlignedModelsConstPtr> received_;
};

TEST_F(AlignNode, AlignsTheKeyFrameAndAgainFromANewRoughPose) {
  waitFor([&] {
    return segmentations_.getNumSubscribers() > 0 && poses_.getNumSubscribers() > 0 &&
           models_.getNumPublishers() > 0;
  }, "the node");
  segmentations_.publish(keyFrame());
  waitFor([&] { return !received_.empty(); }, "the models");

  const calipso_msgs::AlignedModels& first = *received_.back();
  EXPECT_EQ(first.header.stamp, kStamp);
  EXPECT_EQ(first.header.frame_id, "map");
  ASSERT_EQ(first.models.size(), 1u);
  EXPECT_EQ(first.models[0].object, "disc");
  EXPECT_EQ(first.models[0].mesh.triangles, first.models[0].cad.triangles);
  EXPECT_TRUE(first.models[0].trusted) << first.models[0].reason;
  EXPECT_LT(first.models[0].contour_mean_px, 1.0f);  // straight edges against straight edges

  // Behind the camera: published all the same, and marked.
  geometry_msgs::PoseStamped pose;
  pose.header.frame_id = "map";
  pose.pose.position.y = -1.0;
  pose.pose.orientation.w = 1.0;
  const size_t before = received_.size();
  poses_.publish(pose);
  waitFor([&] { return received_.size() > before; }, "the models after a new rough pose");
  ASSERT_EQ(received_.back()->models.size(), 1u);
  EXPECT_FALSE(received_.back()->models[0].trusted);
  EXPECT_NE(received_.back()->models[0].reason.find("behind the camera"), std::string::npos);
}

}  // namespace
}  // namespace calipso::align

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "align_node_rostest");
  return RUN_ALL_TESTS();
}
