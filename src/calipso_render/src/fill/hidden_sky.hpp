#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// InpaintParams::sky, told of pixels that are copies as well. @param origin CV_16SC2
cv::Mat copiedSky(const cv::Mat& sky, const cv::Mat& origin);

// InpaintParams::sky, told of what is hidden as far as the picture's columns tell it: between sky
// and sky, or the picture's upper border, there is nothing else; below things seen against the sky
// that nothing seen holds there is no sky, as what holds them is hidden.
cv::Mat hiddenSky(const cv::Mat& sky);

}  // namespace calipso::render
