#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// Tells what passes (a ball, a walker) from a place that moves by itself (leaves, waves): there the
// mean colours around a place stay about as they are.
class PassingThings {
 public:
  PassingThings() = default;
  // @param frames of one camera; margin px by which masks are grown
  PassingThings(const std::vector<ClipFrame>& frames, int margin);

  // A frame's labels and, with 255, what passes. @param bgr CV_8UC3; labels CV_8UC1
  cv::Mat addedTo(const cv::Mat& labels, const cv::Mat& bgr) const;

 private:
  int margin_ = 0;
  cv::Mat usual_;  // CV_32FC3, code values, one per square
  cv::Mat limit_;  // CV_32FC1, from where on a mean is none of the place; infinite: not known
};

}  // namespace calipso::render
