#pragma once

#include "frame/pixel.hpp"
#include "frame/reflections.hpp"
#include "frame/seen_place.hpp"

namespace calipso::render {

// What comes to light where an object or its shadow was, without what planes mirror: the plate, or
// the frame at hand where the place moves by itself.
class RevealedPlace {
 public:
  // All of them must outlive this.
  RevealedPlace(const StagedFrame& frame, const SeenPlace& place, const Reflections& reflections);

  Pixel at(int u, int v) const;

 private:
  bool drifts(int u, int v) const {
    return !place_.drifts.empty() && place_.drifts.at<std::uint8_t>(v, u) != 0;
  }

  const StagedFrame& frame_;
  const SeenPlace& place_;
  const cv::Mat unmirrored_;  // CV_8UC3
  cv::Mat covered_;           // CV_8UC1, != 0: something else than the place is seen
  LiveFill::Corrections corrections_;
};

}  // namespace calipso::render
