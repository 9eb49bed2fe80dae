#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// How a surface's colour changes slowly over a picture of it, as that of water does with its
// distance: a quadratic in each channel, fitted robustly to what is known, less its median, and no
// darker or brighter than it is there.
// @param image CV_32FC3; known CV_8UC1
// @return CV_32FC3, of the whole picture; 0 if it does not explain most of how the colours vary
cv::Mat colourTrend(const cv::Mat& image, const cv::Mat& known);

}  // namespace calipso::render
