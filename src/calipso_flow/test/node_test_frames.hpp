#pragma once

// Stamps of the frames that node tests send, and waiting for what comes back.

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/Header.h>

namespace calipso::flow {

constexpr double kFps = 30.0;
constexpr double kTimeoutSec = 60.0;
constexpr char kCameraFrame[] = "camera_optical_frame";

inline std_msgs::Header headerOf(int k) {
  std_msgs::Header header;
  header.stamp = ros::Time(100.0 + k / kFps);
  header.frame_id = kCameraFrame;
  return header;
}

// @return whether the condition came true in time
template <class Condition>
bool waitFor(Condition condition) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kTimeoutSec);
  while (ros::ok() && ros::WallTime::now() < end) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.01));
    if (condition()) return true;
  }
  return false;
}

}  // namespace calipso::flow
