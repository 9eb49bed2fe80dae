#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// A part of the place that drifts through the picture as a whole: clouds, the land below an
// aeroplane. What an object hides of it now is seen beside the object at other times: frames are
// laid over each other where they show the same part of it, to one panorama, and what none of them
// shows is invented once, there, so that it drifts along.
class DriftingBackground {
 public:
  DriftingBackground() = default;  // nothing drifts

  // @param frames all as seen from the key frame's camera, which the first of them is; outside the
  // picture labels are 255
  // @param margin px by which masks are grown
  // @param ground CV_8UC1, may be empty: != 0 where a support plane is seen, which rests unless it
  // clearly drifts
  DriftingBackground(const std::vector<ClipFrame>& frames, int margin, const cv::Mat& ground);

  bool established() const { return !where_.empty(); }

  // Something drifts, but the frames' stamps do not rise: when it is where cannot be told.
  bool untimed() const { return untimed_; }

  // CV_8UC1, key frame's view: 255 where it is seen, or hidden by an object.
  const cv::Mat& where() const { return where_; }

  // px by which it has moved since the key frame. None more than a step between frames off the clip.
  std::optional<cv::Point2f> shiftAt(std::int64_t stamp_ns) const;

  // Draws it into a plate, where it is.
  // @param shift as shiftAt()
  // @param plate CV_32FC3, linear, key frame's view
  // @param invented CV_8UC1, likewise: 255 where no frame shows what is drawn
  void draw(const cv::Point2f& shift, cv::Mat& plate, cv::Mat& invented) const;

  // Evens out slow changes of it: brings the plate to what a frame shows around what is covered.
  // @param bgr CV_8UC3, the frame
  // @param covered CV_8UC1, != 0: objects
  void matchTo(const cv::Mat& bgr, const cv::Mat& covered, cv::Mat& plate) const;

 private:
  void layOver(const std::vector<ClipFrame>& frames, const std::vector<cv::Mat>& covered);
  void invent();

  bool untimed_ = false;
  cv::Mat where_;
  std::vector<std::int64_t> stamps_;  // of the frames
  std::vector<cv::Point2f> shifts_;
  cv::Point origin_;  // of the panorama, in pixels of the key frame
  cv::Mat panorama_;  // CV_32FC3, linear
  cv::Mat invented_;  // CV_8UC1
};

}  // namespace calipso::render
