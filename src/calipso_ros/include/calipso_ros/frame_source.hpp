#pragma once

#include <message_filters/subscriber.h>
#include <message_filters/time_synchronizer.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <string>

#include "calipso_ros/mode.hpp"
#include "calipso_ros/video_clock.hpp"
#include "calipso_scene/camera.hpp"

namespace calipso {

// A frame's name as tf2 has it: old drivers write "/camera".
std::string tfName(const std::string& frame_id);

// The camera's pose in the world over time, from tf. Keeps the whole clip, so that a second pass
// over the same stamps finds it again, of live video the last half minute. Listens in its own
// thread; lookups may come from any thread.
class CameraPoses {
 public:
  explicit CameraPoses(Mode mode);

  // @throw std::runtime_error naming frames, stamp and remedy when tf does not know the pose in
  // time
  Eigen::Isometry3d worldFromCamera(const std::string& camera_frame, const ros::Time& stamp) const;

  // What moves, as the video starts over: tf takes nothing that is much older than what it has.
  void forget();

 private:
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
};

// One frame with everything known about how it was taken.
struct Frame {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
  Camera camera;

  const ros::Time& stamp() const { return image->header.stamp; }
};

// Pairs image and camera_info of equal stamps and looks the camera's pose up.
class FrameSource {
 public:
  using OnFrame = std::function<void(const Frame&)>;
  // What makes no Frame (no pose, bad camera_info, stamp 0): the image, and what is wrong.
  using OnBadFrame =
      std::function<void(const sensor_msgs::ImageConstPtr&, const std::string& reason)>;

  // queue: pairs kept while waiting; 0 keeps all. Both callbacks run in the node's callback thread.
  FrameSource(ros::NodeHandle& nh, const std::string& image_topic, const std::string& info_topic,
              unsigned queue, CameraPoses& poses, OnFrame on_frame, OnBadFrame on_bad_frame);

 private:
  void onImage(const sensor_msgs::ImageConstPtr& image);
  void onPair(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);

  CameraPoses& poses_;
  OnFrame on_frame_;
  OnBadFrame on_bad_frame_;
  message_filters::Subscriber<sensor_msgs::Image> image_;
  message_filters::Subscriber<sensor_msgs::CameraInfo> info_;
  message_filters::TimeSynchronizer<sensor_msgs::Image, sensor_msgs::CameraInfo> pairs_;
  const bool live_;  // the queue has an end
  const std::string image_topic_, info_topic_;
  VideoClock clock_;       // live
  unsigned unpaired_ = 0;  // images since the last pair
};

}  // namespace calipso
