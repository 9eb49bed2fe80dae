#pragma once

#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

namespace calipso::flow {

// Dense image flow (OpenCV's dense inverse search). Not thread-safe.
class DenseFlow {
 public:
  enum class Preset { kUltrafast, kFast, kMedium };
  explicit DenseFlow(Preset preset);

  // Motion of every pixel of `from` to `to`, px, CV_32FC2. Outside `region` it is NaN (unknown).
  // @param from, to  8-bit, grey or BGR, of equal size
  // @param region    px; empty: the whole picture
  // @throw std::invalid_argument when the pictures do not fit each other
  cv::Mat compute(const cv::Mat& from, const cv::Mat& to, const cv::Rect& region = {});

 private:
  cv::Ptr<cv::DISOpticalFlow> dis_;
};

}  // namespace calipso::flow
