#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Where a plane goes on behind what hides it, if straight outlines of it run into that: on its side
// of all of them. Lines are found among the places between what is seen of the plane and what is
// seen farther away beside it (RANSAC, fixed seed), and hold if nothing that is seen around
// contradicts them.
// @param on, absent CV_8UC1, != 0: the plane is seen; something farther is seen in its place
// @param to_on, to_absent CV_32FC1, px to the next such place
// @param hidden CV_8UC1, != 0: neither can be told
// @return CV_8UC1, 255 on the plane's side; empty: no straight outline runs into what hides it
cv::Mat withinOutlines(const cv::Mat& on, const cv::Mat& absent, const cv::Mat& to_on,
                       const cv::Mat& to_absent, const cv::Mat& hidden);

}  // namespace calipso::render
