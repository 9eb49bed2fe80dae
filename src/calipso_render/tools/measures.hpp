#pragma once

#include <chrono>
#include <opencv2/core.hpp>
#include <optional>

namespace calipso::render {

// Figures over the pixels where `mask` (CV_8UC1) is not 0; nullopt where there are none.

// Peak signal to noise ratio of two CV_8UC3 pictures, dB; equal pictures give 99.
std::optional<double> psnr(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask);

// Gradient energy of `picture` over that of `truth`: 1 = as textured.
std::optional<double> gradientRatio(const cv::Mat& picture, const cv::Mat& truth,
                                    const cv::Mat& mask);

// Mean absolute change between two pictures, code values.
std::optional<double> change(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask);

// Mean |a - truth| over mean truth, per cent, after the one gain per channel that fits best (an
// albedo is known up to the light's brightness).
std::optional<double> albedoError(const cv::Mat& albedo, const cv::Mat& truth, const cv::Mat& mask);

cv::Mat grow(const cv::Mat& mask, int radius);
cv::Mat shrink(const cv::Mat& mask, int radius);
// What lies within `radius` px of its outline.
cv::Mat rim(const cv::Mat& mask, int radius);

double elapsedMs(std::chrono::steady_clock::time_point since);

void keepLowest(std::optional<double>& lowest, std::optional<double> value);

}  // namespace calipso::render
