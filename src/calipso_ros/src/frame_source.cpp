#include "calipso_ros/frame_source.hpp"

#include <limits>
#include <stdexcept>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso {

namespace {

constexpr double kKeepSec = 1e6;  // longer than any clip
constexpr double kKeepLiveSec = 30.0;
constexpr double kPoseTimeoutSec = 1.0;  // tf and image travel on different connections
constexpr unsigned kUnboundedPairs = 100000;
// Halves of pairs wait at the cost of a pointer. Those left over when live stamps go back are the
// newest, and must not fill the queue.
constexpr unsigned kStrayHalves = 30;
constexpr unsigned kMostUnpaired = 60;  // images in a row, until it is said that they have no pair

void checkSameSize(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info) {
  const auto size = [](auto width, auto height) {
    return std::to_string(width) + " x " + std::to_string(height);
  };
  if (image.width == info.width && image.height == info.height) return;
  throw std::invalid_argument(
      "camera_info is for " + size(info.width, info.height) + " pixels, the image has " +
      size(image.width, image.height) +
      "; calibrate for this size, or name the camera_info that goes with it");
}

unsigned pairQueue(unsigned queue) { return queue == 0 ? kUnboundedPairs : queue + kStrayHalves; }

}  // namespace

std::string tfName(const std::string& frame_id) {
  return frame_id.compare(0, 1, "/") == 0 ? frame_id.substr(1) : frame_id;
}

CameraPoses::CameraPoses(Mode mode)
    : buffer_(ros::Duration(mode == Mode::kLive ? kKeepLiveSec : kKeepSec)), listener_(buffer_) {}

void CameraPoses::forget() { buffer_.clear(); }

Eigen::Isometry3d CameraPoses::worldFromCamera(const std::string& camera_frame,
                                               const ros::Time& stamp) const {
  try {
    return fromMsg(buffer_
                       .lookupTransform(topics::kWorldFrame, tfName(camera_frame), stamp,
                                        ros::Duration(kPoseTimeoutSec))
                       .transform);
  } catch (const tf2::TransformException& error) {
    throw std::runtime_error(std::string("tf has no pose of '") + camera_frame + "' in '" +
                             topics::kWorldFrame + "' at " + std::to_string(stamp.toSec()) +
                             " s (" + error.what() +
                             "); publish it, or run camera_pose_node with the scene");
  }
}

FrameSource::FrameSource(ros::NodeHandle& nh, const std::string& image_topic,
                         const std::string& info_topic, unsigned queue, CameraPoses& poses,
                         OnFrame on_frame, OnBadFrame on_bad_frame)
    : poses_(poses),
      on_frame_(std::move(on_frame)),
      on_bad_frame_(std::move(on_bad_frame)),
      image_(nh, image_topic, queue),
      info_(nh, info_topic, queue),
      pairs_(image_, info_, pairQueue(queue)),
      live_(queue > 0),
      image_topic_(nh.resolveName(image_topic)),
      info_topic_(nh.resolveName(info_topic)) {
  image_.registerCallback(&FrameSource::onImage, this);
  pairs_.registerCallback(&FrameSource::onPair, this);
}

// What has no stamp belongs to no camera_info.
void FrameSource::onImage(const sensor_msgs::ImageConstPtr& image) {
  if (image->header.stamp.isZero())
    on_bad_frame_(image, "its stamp is 0; the camera's driver must stamp images with their time");
  else if (live_ && ++unpaired_ > kMostUnpaired)
    on_bad_frame_(image, info_topic_ +
                             " has nothing with the images' stamps; name the camera's own, and see "
                             "that its driver stamps both alike");
}

void FrameSource::onPair(const sensor_msgs::ImageConstPtr& image,
                         const sensor_msgs::CameraInfoConstPtr& given) {
  const ros::Time& stamp = image->header.stamp;
  if (stamp.isZero()) return;
  unpaired_ = 0;
  if (live_ && clock_.startsOver(stamp)) poses_.forget();
  const auto info =
      boost::make_shared<const sensor_msgs::CameraInfo>(infoOfTopic(image_topic_, *given));
  Frame frame;
  try {
    checkSameSize(*image, *info);
    frame = {image, info, fromMsg(*info, poses_.worldFromCamera(image->header.frame_id, stamp))};
  } catch (const std::exception& error) {
    on_bad_frame_(image, error.what());
    return;
  }
  on_frame_(frame);
}

}  // namespace calipso
