#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "calipso_bag/image_source.hpp"
#include "calipso_scene/camera.hpp"
#include "output_bag.hpp"

namespace calipso::bag {

// Topics and frame of the bags that scene_to_bag and video_to_bag make.
constexpr char kClipImageTopic[] = "/camera/image_raw";
constexpr char kClipCameraInfoTopic[] = "/camera/camera_info";
constexpr char kCameraFrame[] = "camera_optical_frame";
constexpr double kFirstStampSec = 1.0;

// Writes a video as a bag: image, camera_info and, if known, the camera's pose on tf, each frame at
// 1 s + index / fps.
class ClipWriter {
 public:
  // `compressed`: JPEG images (sensor_msgs/CompressedImage) instead of raw ones.
  ClipWriter(const std::string& path, const Camera& camera, double fps, bool compressed);

  // @throw std::runtime_error when the image is not of the camera's size
  void add(const cv::Mat& bgr, const std::optional<Eigen::Isometry3d>& world_from_camera);
  int frameCount() const { return frames_; }
  void finish() { output_.finish(); }

 private:
  void writeImage(const cv::Mat& bgr, const ros::Time& stamp);
  void writePose(const Eigen::Isometry3d& world_from_camera, const ros::Time& stamp);

  OutputBag output_;
  Camera camera_;
  double fps_;
  bool compressed_;
  int frames_ = 0;
};

}  // namespace calipso::bag
