#include "calipso_render/colour.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace calipso::render {
namespace {

double decode(double s) { return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4); }

double encode(double l) { return l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1.0 / 2.4) - 0.055; }

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

// Tabulated over sqrt(linear), in which the curve is nearly straight, so that dark values keep their
// precision (largest error 0.001 code values).
const EncodeTables& encodeTables() {
  static const EncodeTables tables = [] {
    EncodeTables t{};
    const auto code = [](int i) { return static_cast<float>(255.0 * encode(std::pow(static_cast<double>(i) / kEncodeSteps, 2))); };
    for (int i = 0; i < kEncodeSteps; ++i) t.code[i] = code(i), t.rise[i] = code(i + 1) - code(i);
    t.code[kEncodeSteps] = 255.0f, t.rise[kEncodeSteps] = 0.0f;
    return t;
  }();
  return tables;
}

float codeFromLinear(float linear) {
  if (!(linear > 0.0f)) return 0.0f;  // also NaN
  if (linear >= 1.0f) return 255.0f;
  const float x = std::sqrt(linear) * kEncodeSteps;
  const int i = static_cast<int>(x);
  return encodeTables().code[i] + (x - i) * encodeTables().rise[i];
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
