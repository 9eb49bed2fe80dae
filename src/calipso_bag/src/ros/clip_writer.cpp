#include "clip_writer.hpp"

#include <cv_bridge/cv_bridge.h>
#include <tf2_msgs/TFMessage.h>

#include <stdexcept>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso::bag {
namespace {

std_msgs::Header headerAt(const ros::Time& stamp, const std::string& frame) {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = frame;
  return header;
}

}  // namespace

ClipWriter::ClipWriter(const std::string& path, const Camera& camera, double fps, bool compressed)
    : output_(path), camera_(camera), fps_(fps), compressed_(compressed) {}

void ClipWriter::add(const cv::Mat& bgr,
                     const std::optional<Eigen::Isometry3d>& world_from_camera) {
  if (bgr.cols != camera_.width || bgr.rows != camera_.height) {
    throw std::runtime_error("frame " + std::to_string(frames_) + " is " +
                             std::to_string(bgr.cols) + "x" + std::to_string(bgr.rows) +
                             ", but the camera is calibrated for " + std::to_string(camera_.width) +
                             "x" + std::to_string(camera_.height) + "; scale one to the other");
  }
  const ros::Time stamp(kFirstStampSec + frames_ / fps_);
  writeImage(bgr, stamp);
  sensor_msgs::CameraInfo info = toMsg(camera_);
  info.header = headerAt(stamp, kCameraFrame);
  output_.write(kClipCameraInfoTopic, stamp, info);
  if (world_from_camera) writePose(*world_from_camera, stamp);
  ++frames_;
}

void ClipWriter::writeImage(const cv::Mat& bgr, const ros::Time& stamp) {
  const cv_bridge::CvImage image(headerAt(stamp, kCameraFrame), "bgr8", bgr);
  if (compressed_) {
    output_.write(std::string(kClipImageTopic) + "/compressed", stamp,
                  image.toCompressedImageMsg(cv_bridge::JPG));
  } else {
    output_.write(kClipImageTopic, stamp, image.toImageMsg());
  }
}

void ClipWriter::writePose(const Eigen::Isometry3d& world_from_camera, const ros::Time& stamp) {
  tf2_msgs::TFMessage tf;
  tf.transforms.resize(1);
  tf.transforms[0].header = headerAt(stamp, topics::kWorldFrame);
  tf.transforms[0].child_frame_id = kCameraFrame;
  tf.transforms[0].transform = toTransformMsg(world_from_camera);
  output_.write("/tf", stamp, tf);
}

}  // namespace calipso::bag
