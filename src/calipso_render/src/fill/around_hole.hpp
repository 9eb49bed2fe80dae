#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

constexpr int kLeastMargin = 48;  // px around a hole that are looked at, at least

// A hole's box, and around it half its longer side, within limits of px.
cv::Rect windowAround(const cv::Mat& hole, int least = kLeastMargin, int most = 1 << 20);

// @param image CV_32FC3; hole, known CV_8UC1. @return the image, its hole filled by pushPull() of
//   what is known
cv::Mat smoothFill(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& known);

}  // namespace calipso::render
