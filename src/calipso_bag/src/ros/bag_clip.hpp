#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "calipso_ros/frame_source.hpp"

namespace calipso::bag {

struct BagFrame {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;  // header: the image's
};

// The video of a bag: every image with its calibration. The whole bag is checked when it is opened,
// so that nothing goes wrong half-way through an edit. Images are read again in each pass, never
// all held in memory. Not thread-safe.
class BagClip {
 public:
  struct Params {
    std::string path;
    std::string image_topic;        // empty: the only topic of images in the bag
    std::string camera_info_topic;  // empty: beside the image topic, or the only one
  };

  // @throw std::runtime_error naming bag, topic or image, value and remedy
  explicit BagClip(const Params& params);

  int frameCount() const { return static_cast<int>(stamps_.size()); }
  const std::vector<ros::Time>& stamps() const { return stamps_; }
  const std::string& imageTopic() const { return image_topic_; }
  const sensor_msgs::CameraInfo& firstInfo() const { return *first_info_; }
  std::string frameId() const { return tfName(first_info_->header.frame_id); }  // in tf
  // Frames with which another shot begins.
  const std::vector<int>& shotChanges() const { return shot_changes_; }
  double fps() const;  // mean over the clip; 30 for a single frame

  // Reads the frames in their order, from the first.
  class Reader {
   public:
    BagFrame next();  // @pre fewer than frameCount() calls before

   private:
    friend class BagClip;
    explicit Reader(BagClip& clip);
    BagClip& clip_;
    std::unique_ptr<rosbag::View> view_;
    rosbag::View::iterator position_;
  };
  Reader reader() { return Reader(*this); }

  const std::string& path() const { return path_; }
  rosbag::Bag& bag() { return bag_; }

 private:
  void chooseTopics(const Params& params);
  void readCameraInfos();
  void checkFrames();
  sensor_msgs::ImageConstPtr readImage(const rosbag::MessageInstance& message, int index) const;
  sensor_msgs::CameraInfoConstPtr infoFor(const std_msgs::Header& header) const;

  std::string path_;
  rosbag::Bag bag_;
  std::string image_topic_, camera_info_topic_;
  std::map<ros::Time, sensor_msgs::CameraInfo> infos_;  // by stamp
  std::vector<ros::Time> stamps_;
  std::vector<int> shot_changes_;
  sensor_msgs::CameraInfoConstPtr first_info_;
};

}  // namespace calipso::bag
