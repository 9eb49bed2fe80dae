#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Times that a picture is larger than about 640 px, at which rims, penumbrae, steps and errors of
// masks have the size in pixels that they are judged by; 1 for those that are not.
int timesTooLarge(const cv::Size& size);

// A picture brought down, less what of its last rows and columns makes no whole square: means, or
// the values in the squares' middles where those may not mix.
// @param picture of any type; may be empty
cv::Mat reducedMeans(const cv::Mat& picture, int times);
cv::Mat reducedValues(const cv::Mat& picture, int times);

// What was told in a reduced picture, each square where it was; what makes no whole square is as
// that beside it.
// @param whole size of the large picture
// @param by cv::InterpolationFlags
cv::Mat enlargedAgain(const cv::Mat& reduced, const cv::Size& whole, int times, int by);

}  // namespace calipso::render
