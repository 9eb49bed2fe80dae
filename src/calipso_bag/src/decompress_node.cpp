#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/CompressedImage.h>

#include "calipso_ros/node_main.hpp"
#include "calipso_ros/topics.hpp"

namespace {

// image/compressed -> image, for live video from a camera or bag that sends compressed images only.
class DecompressNode {
 public:
  DecompressNode(ros::NodeHandle& nh, ros::NodeHandle&) {
    publisher_ = nh.advertise<sensor_msgs::Image>(calipso::topics::kImage, 10);
    subscriber_ = nh.subscribe(std::string(calipso::topics::kImage) + "/compressed", 10,
                               &DecompressNode::onImage, this);
  }

 private:
  void onImage(const sensor_msgs::CompressedImageConstPtr& compressed) {
    try {
      publisher_.publish(cv_bridge::toCvCopy(*compressed, "bgr8")->toImageMsg());
    } catch (const std::exception& error) {
      ROS_WARN_STREAM_THROTTLE(1.0, "image " << compressed->header.stamp.toSec() << " s of format '"
                                             << compressed->format
                                             << "' cannot be decompressed: " << error.what());
    }
  }

  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
};

}  // namespace

int main(int argc, char** argv) {
  return calipso::runNode<DecompressNode>(argc, argv, "decompress");
}
