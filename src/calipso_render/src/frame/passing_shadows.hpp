#pragma once

#include <opencv2/core.hpp>

#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What a frame is compared with to find shadows that pass in the video, in one camera's view.
struct PlateInView {
  cv::Mat codes;   // CV_8UC3
  cv::Mat darker;  // CV_8UC1: a frame's grey value, averaged over 5 x 5 px, below it is in shadow
  cv::Mat rests;   // CV_8UC1: 255 = seen in other frames, always alike, and not what drifts
  cv::Mat quiet;   // ... nor, as far as a depth image tells, the sky
};

// The shadows of edited objects that move in the video, and no longer follow it, show as darkening
// against the plate. With them goes what masks miss of these objects (missedParts()).
// @param unmirrored CV_8UC3, the frame without what planes mirror of objects at rest
// @param others_sun RestingLight::othersSunInVideo(): what others shade is not taken for theirs
// @param at_key of the key frame's view; made if it is empty
// @return CV_8UC1, whole picture, with a margin; empty: none moves
cv::Mat passingShadows(const StagedFrame& frame, const SeenPlace& place, const cv::Mat& unmirrored,
                       const cv::Mat& others_sun, PlateInView& at_key);

}  // namespace calipso::render
