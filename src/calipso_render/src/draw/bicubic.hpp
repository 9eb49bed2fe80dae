#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/core/hal/intrin.hpp>

namespace calipso::render {

// Catmull-Rom's weights of the four places around one that lies t past the second of them.
inline cv::v_float32x4 bicubicWeights(float t) {
  const cv::v_float32x4 x = cv::v_setall_f32(t);
  const cv::v_float32x4 a(0.0f, 1.0f, 0.0f, 0.0f), b(-0.5f, 0.0f, 0.5f, 0.0f),
      c(1.0f, -2.5f, 2.0f, -0.5f), d(-0.5f, 1.5f, -1.5f, 0.5f);
  return a + x * (b + x * (c + x * d));
}

inline cv::v_float32x4 bicubicAtBorder(const cv::Mat& image, float fu, float fv, cv::v_float32x4 wx,
                                       cv::v_float32x4 wy) {
  const auto clampTo = [](float f, int limit) {
    return f >= -8.0f ? static_cast<int>(std::min(f, limit + 8.0f)) : -8;
  };  // what is no number, too
  const int i = clampTo(fu, image.cols), j = clampTo(fv, image.rows);
  float x[4], y[4];
  cv::v_store(x, wx), cv::v_store(y, wy);
  cv::v_float32x4 sum = cv::v_setzero_f32();
  for (int b = 0; b < 4; ++b) {
    const cv::Vec4f* row = image.ptr<cv::Vec4f>(std::clamp(j - 1 + b, 0, image.rows - 1));
    cv::v_float32x4 line = cv::v_setzero_f32();
    for (int a = 0; a < 4; ++a)
      line +=
          cv::v_setall_f32(x[a]) * cv::v_load(row[std::clamp(i - 1 + a, 0, image.cols - 1)].val);
    sum += cv::v_setall_f32(y[b]) * line;
  }
  return cv::v_max(sum, cv::v_setzero_f32());
}

// sampleBicubic() of four channels in one register. Even and odd columns are summed apart, as
// Kernels::sample does.
inline cv::v_float32x4 bicubic(const cv::Mat& image, float u, float v) {
  const float fu = std::floor(u), fv = std::floor(v);
  const cv::v_float32x4 wx = bicubicWeights(u - fu), wy = bicubicWeights(v - fv);
  if (!(u >= 1.0f && v >= 1.0f && u < image.cols - 2.0f && v < image.rows - 2.0f))
    return bicubicAtBorder(image, fu, fv, wx, wy);
  const cv::v_float32x4 x0 = cv::v_broadcast_element<0>(wx), x1 = cv::v_broadcast_element<1>(wx),
                        x2 = cv::v_broadcast_element<2>(wx), x3 = cv::v_broadcast_element<3>(wx);
  const cv::v_float32x4 y0 = cv::v_broadcast_element<0>(wy), y1 = cv::v_broadcast_element<1>(wy),
                        y2 = cv::v_broadcast_element<2>(wy), y3 = cv::v_broadcast_element<3>(wy);
  const std::size_t step = image.step1();
  const float* p = image.ptr<float>(static_cast<int>(fv) - 1) + 4 * (static_cast<int>(fu) - 1);
  const auto columns = [&](const float* q, const cv::v_float32x4& a, const cv::v_float32x4& b) {
    const auto line = [&](const float* row) {
      return a * cv::v_load(row) + b * cv::v_load(row + 8);
    };
    return (y0 * line(q) + y1 * line(q + step)) +
           (y2 * line(q + 2 * step) + y3 * line(q + 3 * step));
  };
  return cv::v_max(columns(p, x0, x2) + columns(p + 4, x1, x3), cv::v_setzero_f32());
}

}  // namespace calipso::render
