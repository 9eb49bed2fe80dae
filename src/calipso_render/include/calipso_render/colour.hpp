#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace calipso::render {

// Light adds up in linear RGB; pictures hold sRGB code values (IEC 61966-2-1). Linear values here
// are in [0, 1], 1 = code value 255. Channel order is OpenCV's B, G, R.

// Linear values of the 256 code values.
const float* decodeTable();

// Linear value of a code value.
float linearFromCode(std::uint8_t code);

// The same for a code value that is a real number in [0, 255], and for a picture of such.
float linearFromRealCode(float code);
cv::Mat linearFromRealCodes(const cv::Mat& codes);  // CV_32FC3 -> CV_32FC3

// Code value as a real number in [0, 255] of a linear value; clamps to [0, 1] first.
float codeFromLinear(float linear);

// Above kStraight the curve of code values is a polynomial in the fourth root of the linear value
// (largest error 0.001 code values), below it a line.
constexpr float kStraight = 0.0031308f, kStraightRise = 255.0f * 12.92f;
constexpr float kCurve[] = {-15.233448f, 36.199356f, 345.41602f, -210.44641f,
                            158.35558f,  -75.03315f, 15.742248f};

// CV_8UC3 -> CV_32FC3 and back (rounded).
cv::Mat linearFromCode(const cv::Mat& bgr);
cv::Mat codeFromLinear(const cv::Mat& linear);

// Rounds a code value to the nearest representable one.
inline std::uint8_t quantise(float code) {
  return static_cast<std::uint8_t>(code <= 0.0f ? 0 : code >= 255.0f ? 255 : code + 0.5f);
}

// Rec. 709 luminance of a linear B, G, R triple.
inline float luminance(const cv::Vec3f& c) {
  return 0.0722f * c[0] + 0.7152f * c[1] + 0.2126f * c[2];
}
// The same of a picture of code values. @param codes CV_32FC3 @return CV_32FC1
cv::Mat luminanceOf(const cv::Mat& codes);

// Rec. 601 luma of B, G, R code values: what video codecs keep apart from colours.
inline float lumaOf(const cv::Vec3f& code) {
  return 0.114f * code[0] + 0.587f * code[1] + 0.299f * code[2];
}

}  // namespace calipso::render
