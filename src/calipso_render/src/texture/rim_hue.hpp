#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Takes the surroundings' hue out of an object's rim. Videos code hue at half the size, so that it
// mixes across a rim farther than brightness does, by shares that the distance from it tells.
// @param mask CV_8U: the object. @param codes CV_32FC3, code values
void unmixHue(const cv::Mat& mask, cv::Mat& codes);

}  // namespace calipso::render
