#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/stage.hpp"

namespace calipso::render {

// The depth image with the gaps that measured ones have in support planes: nothing is measured on
// what is dark, and a polished plane shows what it mirrors, farther away. Gaps that are narrow
// against the picture, and around a third of which the plane is seen, get its depth. What is seen nearer than
// the planes stays.
// @param depth CV_32FC1, m along the optical axis, 0: unknown; may be empty
// @param labels CV_8UC1, != 0 on objects
cv::Mat mendedDepth(const cv::Mat& depth, const cv::Mat& labels,
                    const std::vector<SupportPlane>& planes, const Camera& camera);

}  // namespace calipso::render
