#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

constexpr float kMedianToSigma = 1.4826f;  // of a normal distribution's median absolute value

// Immerkaer's mask (1996): cancels everything that is linear in the picture. CV_32FC1, 3 x 3.
inline cv::Mat noiseMask() { return (cv::Mat_<float>(3, 3) << 1, -2, 1, -2, 4, -2, 1, -2, 1); }

constexpr float kNoiseMaskGain = 6.0f;  // deviation of what it makes of unit noise

}  // namespace calipso::render
