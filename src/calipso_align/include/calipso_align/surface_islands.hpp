#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::align {

struct Relief;

// Parts of a relief that hang together without a jump. Returns CV_32S: the part's number from 1, 0
// where there is no surface.
// largest_jump: in the relief's units
cv::Mat surfaceIslands(const Relief& relief, float largest_jump);

// What nothing holds to its surroundings is one object, whatever its colours: per pixel the seed
// of an island (of `surfaceIslands`, or of what supports carry) that bears seeds of one object only
// and lies where that may lie; else 0.
// seeds    CV_8U: label number + 1, 0: none; label 0 is the background
// allowed  CV_8U per object, from label 1
cv::Mat seedsOfIslands(const cv::Mat& islands, const cv::Mat& seeds,
                       const std::vector<cv::Mat>& allowed);

}  // namespace calipso::align
