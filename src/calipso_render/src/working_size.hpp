#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Times that a picture is larger than about 640 px, at which rims, penumbrae, steps and errors of
// masks have the size in pixels that they are judged by; 1 for those that are not.
int timesTooLarge(const cv::Size& size);

// A picture brought down, less what of its last rows and columns makes no whole square: means, or
// one value of each square where those may not mix.
// @param picture of any type; may be empty
cv::Mat reducedMeans(const cv::Mat& picture, int times);
cv::Mat reducedValues(const cv::Mat& picture, int times);

}  // namespace calipso::render
