#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// By how many px each row of a picture, with those around it, repeats itself; 0 where it does not.
// For pictures whose stripes lie along their rows: every stripe has a period of its own.
// @param image CV_32FC3, code values; known CV_8UC1
std::vector<float> rowPeriods(const cv::Mat& image, const cv::Mat& known);

}  // namespace calipso::render
