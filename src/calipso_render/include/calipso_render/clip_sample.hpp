#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "calipso_scene/camera.hpp"

namespace calipso::render {

// Where an object was in a frame of the clip.
struct ObjectPose {
  int index = 0;  // label in the masks
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
};

// One frame of the clip with what belongs to which object.
struct ClipFrame {
  cv::Mat bgr;     // CV_8UC3
  cv::Mat labels;  // CV_8UC1: 0 none, else an object's index
  Camera camera;
  std::vector<ObjectPose> poses = {};  // of the rigid objects that move, as far as known
  std::int64_t stamp_ns = 0;
};

// An evenly spaced sample of a clip of unknown length in bounded memory: when the store is full,
// every other frame goes and from then on half as many come in. The first frame (the key frame)
// stays.
class ClipSample {
 public:
  explicit ClipSample(std::size_t capacity = 24) : capacity_(capacity) {}

  // Keeps or drops the frame. Pictures are copied. @throw std::invalid_argument if sizes differ
  void add(const ClipFrame& frame);

  // @return false: it does not have this frame
  bool setLabels(std::int64_t stamp_ns, const cv::Mat& labels);
  void setPicture(std::size_t frame, const cv::Mat& bgr) { frames_.at(frame).bgr = bgr; }
  void setPoses(std::size_t frame, std::vector<ObjectPose> poses) {
    frames_.at(frame).poses = std::move(poses);
  }

  const std::vector<ClipFrame>& frames() const { return frames_; }
  std::size_t seen() const { return seen_; }

 private:
  std::size_t capacity_, stride_ = 1, seen_ = 0;
  std::vector<ClipFrame> frames_;
};

}  // namespace calipso::render
