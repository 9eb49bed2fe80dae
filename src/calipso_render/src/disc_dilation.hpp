#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// cv::dilate() with disc(radius). A disc's rows are runs, and a longer run is a shorter one with a
// pixel more at either end.
// @param from CV_8UC1; of a part of a picture also the pixels around it count
// @param to CV_8UC1 of its size, not the source
void dilateByDisc(const cv::Mat& from, int radius, cv::Mat& to);

}  // namespace calipso::render
