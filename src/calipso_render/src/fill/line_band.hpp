#pragma once

#include <opencv2/core.hpp>

#include "fill/line_ends.hpp"

namespace calipso::render {

// px left and right of a connection of two lines that are drawn with it.
struct LineBand {
  float left, right;
};

// How far what runs along a line, as the other edges of a moulding or a coping do, is seen alike at
// both of its ends; kLineHalf where nothing does.
// @param from left and right are its `into`'s
// @param source CV_8UC1: known; image CV_32FC3, code values
LineBand bandAlong(const LineEnd& from, const LineEnd& to, const cv::Mat& source,
                   const cv::Mat& image);

}  // namespace calipso::render
