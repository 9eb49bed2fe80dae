#include "bag_clip.hpp"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/CompressedImage.h>

#include <boost/make_shared.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <stdexcept>

#include "calipso_bag/shot_changes.hpp"
#include "calipso_ros/conversions.hpp"
#include "clip_checks.hpp"
#include "open_bag.hpp"

namespace calipso::bag {
namespace {

const std::set<std::string> kImageTypes = {"sensor_msgs/Image", "sensor_msgs/CompressedImage"};
const std::set<std::string> kInfoTypes = {"sensor_msgs/CameraInfo"};
const std::string kCompressedSuffix = "/compressed";

std::set<std::string> topicsOf(const rosbag::Bag& bag, const std::set<std::string>& types) {
  rosbag::View view(bag);
  std::set<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (types.count(connection->datatype) > 0) topics.insert(connection->topic);
  }
  return topics;
}

std::string listed(const std::set<std::string>& topics) {
  std::string text;
  for (const std::string& topic : topics) text += (text.empty() ? "" : ", ") + topic;
  return text;
}

// The camera_info that belongs to an image topic by convention: its sibling.
std::string siblingInfo(std::string image_topic) {
  const std::size_t length = image_topic.size(), suffix = kCompressedSuffix.size();
  if (length > suffix && image_topic.compare(length - suffix, suffix, kCompressedSuffix) == 0) {
    image_topic.resize(length - suffix);
  }
  return image_topic.substr(0, image_topic.rfind('/') + 1) + "camera_info";
}

// `wanted` if it is there, the only one if nothing is wanted. @pre there are topics
std::string choose(const std::set<std::string>& topics, const std::string& wanted,
                   const std::string& argument, const std::string& what) {
  if (wanted.empty() && topics.size() == 1) return *topics.begin();
  if (topics.count(wanted) > 0) return wanted;
  throw std::runtime_error(what +
                           (wanted.empty() ? ": not exactly one topic" : ": no topic " + wanted) +
                           "; there: " + listed(topics) + ". Choose with " + argument + ":=");
}

}  // namespace

BagClip::BagClip(const Params& params) : path_(params.path) {
  openForReading(bag_, path_);
  try {
    chooseTopics(params);
    readCameraInfos();
    checkFrames();
  } catch (const rosbag::BagException& e) {
    throw damaged(path_, e);
  }
}

double BagClip::fps() const {
  constexpr double kSingleFrameFps = 30.0;
  if (stamps_.size() < 2) return kSingleFrameFps;
  return (frameCount() - 1) / (stamps_.back() - stamps_.front()).toSec();
}

void BagClip::chooseTopics(const Params& params) {
  const std::set<std::string> images = topicsOf(bag_, kImageTypes);
  if (images.empty())
    throw std::runtime_error(path_ + ": no images; record sensor_msgs/Image or CompressedImage");
  image_topic_ = choose(images, params.image_topic, "image_topic", path_ + ": images");
  const std::set<std::string> infos = topicsOf(bag_, kInfoTypes);
  if (infos.empty()) {
    throw std::runtime_error(path_ + ": no camera_info for " + image_topic_ +
                             "; record it, or make the bag with video_to_bag and a calibration");
  }
  const std::string sibling = siblingInfo(image_topic_);
  const bool by_convention = params.camera_info_topic.empty() && infos.count(sibling) > 0;
  camera_info_topic_ = choose(infos, by_convention ? sibling : params.camera_info_topic,
                              "camera_info_topic", path_ + ": camera_info");
}

void BagClip::readCameraInfos() {
  rosbag::View view(bag_, rosbag::TopicQuery(camera_info_topic_));
  for (const rosbag::MessageInstance& message : view) {
    const auto info = message.instantiate<sensor_msgs::CameraInfo>();
    infos_[info->header.stamp] = infoOfTopic(image_topic_, *info);
  }
  if (infos_.empty()) {
    throw std::runtime_error(path_ + ": topic " + camera_info_topic_ + " holds no message");
  }
}

void BagClip::checkFrames() {
  rosbag::View view(bag_, rosbag::TopicQuery(image_topic_));
  sensor_msgs::ImageConstPtr first;
  ShotChanges shots;
  for (const rosbag::MessageInstance& message : view) {
    const int index = frameCount();
    const std::string where = path_ + ": " + image_topic_ + " image " + std::to_string(index);
    const sensor_msgs::ImageConstPtr image = readImage(message, index);
    checkImage(*image, where);
    if (first) checkFollows(*image, *first, stamps_.back(), where);
    const sensor_msgs::CameraInfoConstPtr info = infoFor(image->header);
    checkCameraInfo(*info, *image, where);
    if (!first) {
      first = image;
      first_info_ = info;
    }
    shots.add(cv_bridge::toCvShare(image)->image);
    stamps_.push_back(image->header.stamp);
  }
  if (stamps_.empty()) {
    throw std::runtime_error(path_ + ": topic " + image_topic_ + " holds no image");
  }
  shot_changes_ = shots.found();
}

sensor_msgs::ImageConstPtr BagClip::readImage(const rosbag::MessageInstance& message,
                                              int index) const {
  if (message.isType<sensor_msgs::Image>()) return message.instantiate<sensor_msgs::Image>();
  const auto compressed = message.instantiate<sensor_msgs::CompressedImage>();
  try {
    return cv_bridge::toCvCopy(*compressed, "bgr8")->toImageMsg();
  } catch (const std::exception&) {
    throw std::runtime_error(path_ + ": " + image_topic_ + " image " + std::to_string(index) +
                             " of format '" + compressed->format +
                             "' cannot be decompressed; use JPEG or PNG");
  }
}

// The calibration of the same stamp; else the last one before it; else the first.
sensor_msgs::CameraInfoConstPtr BagClip::infoFor(const std_msgs::Header& header) const {
  auto after = infos_.upper_bound(header.stamp);
  if (after != infos_.begin()) --after;
  const auto info = boost::make_shared<sensor_msgs::CameraInfo>(after->second);
  info->header = header;
  return info;
}

BagClip::Reader::Reader(BagClip& clip)
    : clip_(clip),
      view_(std::make_unique<rosbag::View>(clip.bag_, rosbag::TopicQuery(clip.image_topic_))),
      position_(view_->begin()) {}

BagFrame BagClip::Reader::next() {
  BagFrame frame;
  frame.image = clip_.readImage(*position_++, 0);
  frame.info = clip_.infoFor(frame.image->header);
  return frame;
}

}  // namespace calipso::bag
