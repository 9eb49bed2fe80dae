#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "place/plane_extent.hpp"

namespace calipso::render {

// A support plane, gone on, passes through a wall behind it: along a strip either explains what is
// seen. Strips away from what the support alone explains are the other plane's. And what lies on a
// support plane (a picture on a wall) is so near to it that other planes, gone on, pass through it
// by chance: pieces of them as near to a support, and apart from the rest of them, are the
// support's.
// @param planes the supports first
// @param thin part of the nearness up to which something lies on a support
// @param seen CV_8SC1, of every pixel the plane, or kNoPlane
void settleCrossings(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes,
                     float thin, cv::Mat& seen);

}  // namespace calipso::render
