#include "calipso_render/colour.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace calipso::render {
namespace {

double decode(double s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); }

}  // namespace

const float* decodeTable() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) t[i] = static_cast<float>(decode(i / 255.0));
    return t;
  }();
  return table.data();
}

float linearFromCode(std::uint8_t code) { return decodeTable()[code]; }

float linearFromRealCode(float code) {
  const float x = std::clamp(code, 0.0f, 254.999f);
  const int i = static_cast<int>(x);
  const float* table = decodeTable();
  return table[i] + (x - i) * (table[i + 1] - table[i]);
}

cv::Mat linearFromRealCodes(const cv::Mat& codes) {
  CV_Assert(codes.type() == CV_32FC3);
  cv::Mat linear(codes.size(), CV_32FC3);
  for (int v = 0; v < codes.rows; ++v) {
    const float* in = codes.ptr<float>(v);
    float* out = linear.ptr<float>(v);
    for (int i = 0; i < 3 * codes.cols; ++i) out[i] = linearFromRealCode(in[i]);
  }
  return linear;
}

float codeFromLinear(float linear) {
  if (!(linear > 0.0f)) return 0.0f;  // also NaN
  if (linear >= 1.0f) return 255.0f;
  if (linear <= kStraight) return kStraightRise * linear;
  const float root = std::sqrt(std::sqrt(linear));
  float code = kCurve[6];
  for (int k = 5; k >= 0; --k) code = code * root + kCurve[k];
  return code;
}

cv::Mat linearFromCode(const cv::Mat& bgr) {
  CV_Assert(bgr.type() == CV_8UC3);
  cv::Mat linear(bgr.size(), CV_32FC3);
  const float* table = decodeTable();
  for (int v = 0; v < bgr.rows; ++v) {
    const std::uint8_t* in = bgr.ptr<std::uint8_t>(v);
    float* out = linear.ptr<float>(v);
    for (int i = 0; i < 3 * bgr.cols; ++i) out[i] = table[in[i]];
  }
  return linear;
}

cv::Mat luminanceOf(const cv::Mat& codes) {
  const cv::Mat linear = linearFromRealCodes(codes);
  cv::Mat of(codes.size(), CV_32F);
  for (int v = 0; v < codes.rows; ++v) {
    for (int u = 0; u < codes.cols; ++u) of.at<float>(v, u) = luminance(linear.at<cv::Vec3f>(v, u));
  }
  return of;
}

cv::Mat codeFromLinear(const cv::Mat& linear) {
  CV_Assert(linear.type() == CV_32FC3);
  cv::Mat bgr(linear.size(), CV_8UC3);
  for (int v = 0; v < linear.rows; ++v) {
    const float* in = linear.ptr<float>(v);
    std::uint8_t* out = bgr.ptr<std::uint8_t>(v);
    for (int i = 0; i < 3 * linear.cols; ++i) out[i] = quantise(codeFromLinear(in[i]));
  }
  return bgr;
}

}  // namespace calipso::render
