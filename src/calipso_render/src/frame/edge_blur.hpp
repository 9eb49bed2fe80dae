#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// By how much the outlines in a picture are softer than pixels make them: lens, demosaicing, video
// codec. Steps of a pixel's width, blurred, are fitted to the brightness across the objects'
// outlines, wherever it is clearly another on either side. What lies beside an outline makes it look
// softer than it is, never sharper: a lower quantile of all places counts.
// @param picture CV_32FC3, code values
// @param labels CV_8UC1, 0: no object
// @return standard deviation, px; the usual one where too few places tell it
float outlineBlur(const cv::Mat& picture, const cv::Mat& labels);

// The same of their colours beside their brightness, in code values: video codecs keep those at
// half the size, and coarser.
// @return standard deviation, px; 0 where too few places tell it
float colourBlur(const cv::Mat& picture, const cv::Mat& labels);

}  // namespace calipso::render
