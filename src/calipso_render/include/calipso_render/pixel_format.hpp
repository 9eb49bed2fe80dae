#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace calipso::render {

enum class PixelFormat { kBgr8, kRgb8, kMono8, kBgra8, kRgba8 };

// Format of a ROS image encoding.
// @throw std::invalid_argument naming the encoding and those that can be edited (16-bit ones
// cannot)
PixelFormat pixelFormat(const std::string& encoding);

int channels(PixelFormat format);

// A picture as CV_8UC3 BGR. `image` has channels(format) bytes per pixel.
cv::Mat toBgr(const cv::Mat& image, PixelFormat format);

// Writes the pixels of `bgr` where `changed` (CV_8UC1) is not 0 into `image`, in its format. Every
// other byte, and alpha, stays as it is.
void writeChanged(const cv::Mat& bgr, const cv::Mat& changed, PixelFormat format, cv::Mat& image);

}  // namespace calipso::render
