#include <sensor_msgs/CameraInfo.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/node_main.hpp"
#include "calipso_ros/topics.hpp"
#include "ros/near_markers.hpp"

namespace {

constexpr double kBufferSec = 1e6;  // the player sends the whole clip's poses at its beginning

// Gives rviz's view through the camera what is too far away for it.
class NearMarkersNode {
 public:
  NearMarkersNode(ros::NodeHandle& nh, ros::NodeHandle&)
      : buffer_(ros::Duration(kBufferSec)), listener_(buffer_) {
    publisher_ = nh.advertise<visualization_msgs::MarkerArray>("markers/near", 2);
    info_ = nh.subscribe<sensor_msgs::CameraInfo>(
        calipso::topics::kCameraInfo, 1,
        [this](const auto& info) { camera_frame_ = info->header.frame_id; });
    markers_ = nh.subscribe(calipso::topics::kMarkers, 2, &NearMarkersNode::onMarkers, this);
  }

 private:
  void onMarkers(const visualization_msgs::MarkerArrayConstPtr& markers) {
    if (camera_frame_.empty() || markers->markers.empty()) return;
    try {
      const auto pose = buffer_.lookupTransform(camera_frame_, calipso::topics::kWorldFrame,
                                                markers->markers.front().header.stamp);
      publisher_.publish(
          calipso::bag::nearMarkers(*markers, calipso::fromMsg(pose.transform), camera_frame_));
    } catch (const tf2::TransformException& error) {
      ROS_WARN_STREAM_THROTTLE(10.0, "markers far from the camera are not shown: " << error.what());
    }
  }

  std::string camera_frame_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
  ros::Publisher publisher_;
  ros::Subscriber info_, markers_;
};

}  // namespace

int main(int argc, char** argv) {
  return calipso::runNode<NearMarkersNode>(argc, argv, "near_markers");
}
