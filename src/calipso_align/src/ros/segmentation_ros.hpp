#pragma once

#include <calipso_msgs/Segmentation.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>

#include <memory>
#include <string>

#include "calipso_align/key_frame.hpp"
#include "calipso_align/mask_tracker.hpp"
#include "calipso_ros/mode.hpp"
#include "calipso_ros/node_reporter.hpp"
#include "calipso_ros/video_clock.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::align {

struct SegmentationNodeParams {
  std::string scene;  // directory with scene.yaml
  Mode mode = Mode::kBag;
  bool use_depth = true;  // the scene's depth image, where it has one; of a bag only
};

// @throw std::invalid_argument naming parameter, value and what is allowed
SegmentationNodeParams loadSegmentationParams(const ros::NodeHandle& pnh);

// Wires Segmenter and MaskTracker to topics: the first frame is segmented, the others are tracked.
// All callbacks run in the one spinning thread.
class SegmentationRos {
 public:
  SegmentationRos(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void onImage(const sensor_msgs::ImageConstPtr& msg);
  void onStrokes(const sensor_msgs::ImageConstPtr& msg);
  void onSubscriber(const ros::SingleSubscriberPublisher& subscriber);

  void startOver();
  void adoptKeyFrame(const sensor_msgs::ImageConstPtr& msg);
  void segment(const cv::Mat& strokes);  // the key frame. @throw std::exception saying why not
  void trackFrame(const sensor_msgs::ImageConstPtr& msg);
  void publishOverlay(const KeyFrame& key);

  SegmentationNodeParams params_;
  Scene scene_;
  NodeReporter reporter_;
  ros::Publisher segmentation_publisher_, overlay_publisher_;
  ros::Subscriber image_subscriber_, strokes_subscriber_;

  VideoClock clock_;  // live
  cv::Mat strokes_;
  ros::Time last_stamp_;
  std_msgs::Header key_header_;
  cv::Mat key_image_;  // empty before the first frame
  std::unique_ptr<Segmenter> segmenter_;
  cv::Mat labels_;                                  // of the newest frame that could be read
  std::unique_ptr<MaskTracker> tracker_;            // null while there is no segmentation
  calipso_msgs::SegmentationConstPtr key_message_;  // handed to every new subscriber
};

}  // namespace calipso::align
