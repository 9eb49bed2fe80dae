#include <calipso_msgs/NodeStatus.h>
#include <sensor_msgs/CameraInfo.h>

#include <map>
#include <string>

#include "calipso_ros/node_main.hpp"
#include "calipso_ros/topics.hpp"
#include "calipso_scene/scene.hpp"
#include "ros/edit_files.hpp"

namespace {

// Sends a file of edits into a running graph. Live video has no first frame to count from: the
// times of the edits count from the first frame after the simulator and the renderer are ready.
// They are sent again when the simulator has started over, because the video has.
void sendEdits(ros::NodeHandle& nh, const ros::NodeHandle& pnh) {
  const calipso::Scene scene = calipso::loadScene(calipso::pathParam(pnh, "scene"));
  const std::string path = calipso::pathParam(pnh, "edits");
  calipso::bag::readEdits(path, scene, ros::Time(1.0));  // complain early

  std::map<std::string, std::uint8_t> state_of;  // a node that failed may be ready again
  ros::Publisher edits = nh.advertise<calipso_msgs::Edit>(calipso::topics::kEdits, 1000);
  const auto ready = [&](const std::string& node) {
    return state_of[node] == calipso_msgs::NodeStatus::READY;
  };
  bool due = true;
  const boost::function<void(const calipso_msgs::NodeStatusConstPtr&)> on_status =
      [&](const calipso_msgs::NodeStatusConstPtr& status) {
        state_of[status->node] = status->state;
        due = due || (status->node == "simulator" && status->state == status->STARTING);
      };
  const boost::function<void(const sensor_msgs::CameraInfoConstPtr&)> on_frame =
      [&](const sensor_msgs::CameraInfoConstPtr& info) {
        if (!due || !ready("simulator") || !ready("render") || edits.getNumSubscribers() == 0)
          return;
        due = false;
        const ros::Time first = info->header.stamp;
        for (const auto& edit : calipso::bag::readEdits(path, scene, first)) edits.publish(edit);
        ROS_INFO_STREAM("edits sent; they count from the frame at " << first.toSec() << " s");
      };
  const auto statuses =
      nh.subscribe<calipso_msgs::NodeStatus>(calipso::topics::kStatus, 1000, on_status);
  const auto frames =
      nh.subscribe<sensor_msgs::CameraInfo>(calipso::topics::kCameraInfo, 1, on_frame);
  ros::spin();
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "send_edits");
  ros::NodeHandle nh;
  const ros::NodeHandle pnh("~");
  try {
    sendEdits(nh, pnh);
    return 0;
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM("send_edits: " << error.what());
    return 1;
  }
}
