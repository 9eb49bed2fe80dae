#pragma once

#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <string>

// Small messages of one camera, to be spoilt by a test and written to a bag.
namespace test_clip {

constexpr unsigned kWidth = 8, kHeight = 6;

inline sensor_msgs::Image image(double stamp_sec, unsigned char grey = 100) {
  sensor_msgs::Image image;
  image.header.stamp = ros::Time(stamp_sec);
  image.header.frame_id = "camera_optical_frame";
  image.width = kWidth;
  image.height = kHeight;
  image.encoding = "bgr8";
  image.step = 3 * kWidth;
  image.data.assign(image.step * kHeight, grey);
  return image;
}

inline sensor_msgs::CameraInfo info(double stamp_sec) {
  sensor_msgs::CameraInfo info;
  info.header.stamp = ros::Time(stamp_sec);
  info.header.frame_id = "camera_optical_frame";
  info.width = kWidth;
  info.height = kHeight;
  info.K = {10.0, 0.0, 3.5, 0.0, 10.0, 2.5, 0.0, 0.0, 1.0};
  return info;
}

inline void write(rosbag::Bag& bag, const sensor_msgs::Image& image) {
  bag.write("/camera/image_raw", image.header.stamp, image);
}

inline void write(rosbag::Bag& bag, const sensor_msgs::CameraInfo& info) {
  bag.write("/camera/camera_info", info.header.stamp, info);
}

}  // namespace test_clip
