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
cv_bridge::CvImagePtr decode(const rosbag::MessageInstance& message) {
  if (const auto compressed = message.instantiate<sensor_msgs::CompressedImage>()) {
    return cv_bridge::toCvCopy(*compressed, "bgr8");
  }
  const auto image = message.instantiate<sensor_msgs::Image>();
  if (!image) throw std::runtime_error("not an image");
  return cv_bridge::toCvCopy(*image, "bgr8");
}

}  // namespace

void forEachImage(const std::string& bag_path, const std::string& topic,
                  const std::function<void(const cv::Mat&, const ros::Time&)>& use) {
  const std::string who = bag_path + ", topic " + topic + ": ";
  rosbag::Bag bag;
  openForReading(bag, bag_path);
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  if (view.size() == 0) throw std::runtime_error(who + "no message; see 'rosbag info'");
  for (const rosbag::MessageInstance& message : view) {
    cv_bridge::CvImagePtr image;
    try {
      image = decode(message);
    } catch (const std::exception& error) {
      throw std::runtime_error(who + error.what() + "; give a topic of pictures");
    }
    use(image->image, image->header.stamp);
  }
}

}  // namespace calipso::bag
