#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Evens out the seams of a hole filled with shifted copies: keeps every copy's differences between
// neighbours, and spreads what does not meet at a seam over some twenty pixels, what is too much for
// a seam over two (screened Poisson equation).
// @param image CV_32FC3, filled
// @param hole CV_8UC1
// @param source CV_8UC1, known pixels
// @param origin CV_16SC2, per hole pixel what it is a copy of; (-1, -1): of nothing
// @param planes CV_8UC1, number of the plane that is seen, 0 unknown; may be empty: where one gives
// way to another there is an edge, and no seam
// @param sky InpaintParams::sky; may be empty: within it, and beside it unless something is
// known to be seen, every step is a seam
void blendSeams(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& origin,
                const cv::Mat& planes, const cv::Mat& sky, cv::Mat& image);

}  // namespace calipso::render
