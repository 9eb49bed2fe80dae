#pragma once

#include <opencv2/core.hpp>

#include "frame/seen_place.hpp"

namespace calipso::render {

// Where the depth image or the user's matte puts something before what is drawn, with a soft edge.
class Screen {
 public:
  // @param seen over the region that an edit can change
  Screen(const StagedFrame& frame, const SeenPlace& place, const VisibilityBuffer& seen);

  // CV_8UC1 over the region: 255 = what is drawn is hidden; empty: nowhere
  const cv::Mat& levels() const { return levels_; }
  // The part of a pixel of the picture that is hidden.
  float at(int u, int v) const {
    return levels_.empty() ? 0.0f : levels_.at<std::uint8_t>(v - corner_.y, u - corner_.x) / 255.0f;
  }

 private:
  cv::Point corner_;
  cv::Mat levels_;
};

}  // namespace calipso::render
