#include <sensor_msgs/CameraInfo.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/node_main.hpp"
#include "calipso_ros/topics.hpp"
#include "calipso_scene/scene.hpp"

namespace {

// Publishes the fixed pose that scene.yaml gives the camera, for live video without tf. The frame's
// name comes with the first camera_info.
class CameraPoseNode {
 public:
  CameraPoseNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
      : scene_(calipso::loadScene(calipso::pathParam(pnh, "scene"))) {
    if (scene_.camera_moves || !scene_.world_from_camera_per_frame.empty()) {
      throw std::invalid_argument("the camera of scene '" + scene_.name +
                                  "' moves; its pose has to come from tf");
    }
    subscriber_ =
        nh.subscribe(calipso::topics::kCameraInfo, 1, &CameraPoseNode::onCameraInfo, this);
  }

 private:
  void onCameraInfo(const sensor_msgs::CameraInfoConstPtr& info) {
    if (info->header.frame_id == frame_) return;
    frame_ = info->header.frame_id;
    geometry_msgs::TransformStamped pose;
    pose.header.stamp = info->header.stamp;
    pose.header.frame_id = calipso::topics::kWorldFrame;
    pose.child_frame_id = frame_;
    pose.transform = calipso::toTransformMsg(scene_.camera.world_from_camera);
    broadcaster_.sendTransform(pose);
  }

  calipso::Scene scene_;
  std::string frame_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  ros::Subscriber subscriber_;
};

}  // namespace

int main(int argc, char** argv) {
  return calipso::runNode<CameraPoseNode>(argc, argv, "camera_pose");
}
