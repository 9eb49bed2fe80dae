#pragma once

#include <opencv2/core.hpp>

#include "frame/moved_shadow.hpp"
#include "frame/reflections.hpp"
#include "frame/resting_light.hpp"
#include "frame/shaded_others.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What of the picture an edit can change.
struct EditedRegion {
  // @param passing CV_8UC1, whole picture: passingShadows(); may be empty
  EditedRegion(const StagedFrame& frame, const RestingLight& resting, const MovedShadow& moved,
               const ShadedOthers& others, const Reflections& reflections, const cv::Mat& passing);

  cv::Rect all;  // may be empty
  // Parts of it, with a margin: what is drawn; where the place can come to light
  cv::Rect drawn, revealed;
};

}  // namespace calipso::render
