#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// What is known of a picture less its mean around: light is no pattern. 0 elsewhere.
// @param image CV_32F, any channels; known CV_8UC1
// @param deviation px, of the mean
cv::Mat levelled(const cv::Mat& image, const cv::Mat& known, double deviation);

}  // namespace calipso::render
