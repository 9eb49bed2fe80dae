#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Coefficients of the cubic spline through a picture's values (Unser 1999), CV_32FC3: samples between pixels lose less
// of what is fine than others of four by four.
cv::Mat splineOf(const cv::Mat& image);

// The spline at a place; beyond the picture it is mirrored at the border.
cv::Vec3f sampleSpline(const cv::Mat& coefficients, double u, double v);

}  // namespace calipso::render
