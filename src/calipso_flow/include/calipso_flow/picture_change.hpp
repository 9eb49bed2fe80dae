#pragma once

#include <opencv2/core.hpp>

namespace calipso::flow {

// The most, in px, that what is shown at `where` can have shifted between two pictures, whichever
// way: a shift s changes the picture by grad I . s, so that |s|^2 <= sum (I' - I)^2 / l, l the
// smaller eigenvalue of sum grad I grad I^T. Noise and all other changes count as motion. Infinite
// where the picture varies in one direction only, or not at all. Holds as long as the gradient
// does: over about a pixel; farther shifts change the picture by no less unless it repeats itself.
// @param before, now  CV_32F, of one size
// @param where  CV_8U, non-zero where it counts; lies at `origin` in the pictures
double largestShift(const cv::Mat& before, const cv::Mat& now, const cv::Mat& where,
                    const cv::Point& origin);

}  // namespace calipso::flow
