#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// What a footprint misses of its object along the rim, or what the object alone leaves there (a thin
// dark line where it touches the place): pixels just outside its margin, hanging together with it,
// that look like nothing that is seen farther out. CV_8UC1
// @param picture CV_32FC3, code values
// @param footprint, others CV_8UC1: != 0 where the object covers the picture, and where others are
// @param margin px around a footprint that go with it
cv::Mat rimRemains(const cv::Mat& picture, const cv::Mat& footprint, const cv::Mat& others,
                   int margin);

}  // namespace calipso::render
