#include "bag_images.hpp"

#include <cv_bridge/cv_bridge.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CompressedImage.h>

#include <stdexcept>

#include "open_bag.hpp"

namespace calipso::bag {
namespace {

// BGR of an image message of either kind; what carries no colour is shown as grey.
// @throw std::runtime_error starting with `who` for any other message or encoding
cv_bridge::CvImagePtr decode(const rosbag::MessageInstance& message, const std::string& who) {
  const auto compressed = message.instantiate<sensor_msgs::CompressedImage>();
  const auto image = message.instantiate<sensor_msgs::Image>();
  if (!compressed && !image)
    throw std::runtime_error(who + message.getDataType() + "; give a topic of pictures");
  try {
    return compressed ? cv_bridge::toCvCopy(*compressed, "bgr8")
                      : cv_bridge::toCvCopy(*image, "bgr8");
  } catch (const std::exception& error) {
    throw std::runtime_error(who + error.what() + "; give a topic of pictures in colour or grey");
  }
}

}  // namespace

void forEachImage(const std::string& bag_path, const std::string& topic,
                  const std::function<void(const cv::Mat&, const ros::Time&)>& use) {
  const std::string who = bag_path + ", topic " + topic + ": ";
  rosbag::Bag bag;
  openForReading(bag, bag_path);
  try {
    rosbag::View view(bag, rosbag::TopicQuery(topic));
    if (view.size() == 0) throw std::runtime_error(who + "no message; see 'rosbag info'");
    for (const rosbag::MessageInstance& message : view) {
      const cv_bridge::CvImagePtr image = decode(message, who);
      use(image->image, image->header.stamp);
    }
  } catch (const rosbag::BagException& error) {
    throw damaged(bag_path, error);
  }
}

}  // namespace calipso::bag
