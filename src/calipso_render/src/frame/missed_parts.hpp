#pragma once

#include <opencv2/core.hpp>

#include "frame/passing_shadows.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What masks miss of edited objects that move in the video and no longer follow it: where their
// models are seen (about their masks, if no pose is known), no object is labelled, and the picture
// is unlike a plate that is known well; and of those that are gone from where the video has them
// what is thin and hangs on them there, such as ropes that no model has.
// @param now CV_8UC3, the frame that the plate is compared with
// @return CV_8UC1, whole picture
cv::Mat missedParts(const StagedFrame& frame, const PlateInView& plate, const cv::Mat& now);

}  // namespace calipso::render
