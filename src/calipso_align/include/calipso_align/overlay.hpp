#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/contour.hpp"

namespace calipso::align {

// The picture (CV_8UC3) with every object tinted in its own colour and its contour drawn: bright
// where the edge is known, dark where it is hidden.
cv::Mat drawOverlay(const cv::Mat& image, const cv::Mat& labels,
                    const std::vector<ObjectContour>& contours);

}  // namespace calipso::align
