#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// The parts of a predicted shadow that the picture shows: along the part's border the inside is darker than the outside. A part
// whose border cannot be judged (too short, or all of it beside objects) is believed.
// @param predicted CV_8UC1, 255 = in shadow
// @param picture CV_32FC3, code values
// @param labels CV_8UC1; pixels of objects tell nothing of the ground
cv::Mat seenShadows(const cv::Mat& predicted, const cv::Mat& picture, const cv::Mat& labels);

}  // namespace calipso::render
