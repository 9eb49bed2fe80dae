#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

struct Drift {
  std::vector<cv::Point2f> shifts;  // px, per frame: how far it has come since the first
  cv::Mat where;  // CV_8UC1, 255: the picture drifts there; empty: nowhere that can be told
};

// A movement that a part of the picture makes as a whole. It is established if it explains most of
// what changes from frame to frame. Large pictures are searched reduced, and then followed exactly.
// @param covered per frame, CV_8UC1, != 0: the place is not seen
// @param ground CV_8UC1, may be empty, != 0: what does not clearly drift there rests
Drift findDrift(const std::vector<ClipFrame>& frames, const std::vector<cv::Mat>& covered,
                const cv::Mat& ground);

// A picture displaced by a part of a pixel or more: out(p) = image(p + by) for the pixels of `out`,
// its border repeated (Catmull-Rom).
// @param image CV_32F, any channels
cv::Mat displaced(const cv::Mat& image, const cv::Point2f& by, const cv::Size& out);

}  // namespace calipso::render
