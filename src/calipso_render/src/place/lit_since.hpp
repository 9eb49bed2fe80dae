#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Where the key frame is shaded, as predicted, and the plate is lit. CV_8UC1.
// @param picture, plate CV_32FC3, code values: the key frame, and the plate
// @param left CV_32FC1: part of the brightness that the objects leave at the key frame, as predicted
// @param umbra of the brightness, what the sun's absence leaves; margin px, the prediction's error
cv::Mat litSince(const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& left, double umbra,
                 int margin);

}  // namespace calipso::render
