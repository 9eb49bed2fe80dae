#pragma once

#include <opencv2/core.hpp>

#include "calipso_scene/camera.hpp"

namespace calipso::render {

// true: both cameras see the same picture of a resting world.
bool sameView(const Camera& a, const Camera& b);

// Where each pixel of `to` lies in the picture of `from` (CV_32FC2, for cv::remap).
// @param nearness CV_32FC1, 1/m, of what `to` sees; 0: infinitely far
cv::Mat viewWarp(const cv::Mat& nearness, const Camera& from, const Camera& to);

}  // namespace calipso::render
