#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "place/plane_extent.hpp"

namespace calipso::render {

// A support plane, gone on, passes through a wall behind it: along a strip either explains what is
// seen. Strips away from what the support alone explains are the other plane's.
// @param planes the supports first @param seen CV_8SC1, of every pixel the plane, or kNoPlane
void leaveStrips(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes,
                 cv::Mat& seen);

}  // namespace calipso::render
