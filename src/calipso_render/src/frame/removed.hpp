#pragma once

#include <opencv2/core.hpp>

#include "frame/edited_region.hpp"
#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What the video shows of edited objects and their shadows: pixels behind which the place comes to
// light. What objects show has a margin, but not what stands beside them.
// @param passing CV_8UC1, whole picture: passingShadows(); may be empty
// @param mirrored Reflections::marks(): where that changes and hid all of a plane, it comes to light
// @return CV_8UC1 over the region
cv::Mat removedPixels(const StagedFrame& frame, const SeenPlace& place, const EditedRegion& region,
                      const cv::Mat& passing, const cv::Mat& mirrored);

// The pixels of `box` that show an object in the video. CV_8UC1
cv::Mat shownOf(const StagedFrame& frame, const SeenPlace& place, int surface, const cv::Rect& box);

}  // namespace calipso::render
