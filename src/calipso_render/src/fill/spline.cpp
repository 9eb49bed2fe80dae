#include "fill/spline.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

const float kPole = std::sqrt(3.0f) - 2.0f;

// Coefficients along a line of values, in place, mirrored at both ends.
void filterLine(cv::Vec3f* c, int count, std::ptrdiff_t step) {
  if (count < 2) return;
  constexpr int kReach = 12;  // the pole's power is below 1e-6 there
  cv::Vec3f first = c[0];
  float power = kPole;
  for (int k = 1; k < std::min(kReach, count); ++k, power *= kPole) first += power * c[k * step];
  c[0] = 6.0f * first;
  for (int k = 1; k < count; ++k) c[k * step] = 6.0f * c[k * step] + kPole * c[(k - 1) * step];
  cv::Vec3f* last = c + (count - 1) * step;
  *last = kPole / (kPole * kPole - 1.0f) * (*last + kPole * *(last - step));
  for (int k = count - 2; k >= 0; --k) c[k * step] = kPole * (c[(k + 1) * step] - c[k * step]);
}

cv::Vec4f weights(float t) {
  const float s = 1.0f - t;
  return {s * s * s / 6.0f, 2.0f / 3.0f - 0.5f * t * t * (2.0f - t),
          2.0f / 3.0f - 0.5f * s * s * (2.0f - s), t * t * t / 6.0f};
}

int mirrored(int i, int count) {
  const int last = count - 1;
  return std::clamp(i < 0 ? -i : i > last ? 2 * last - i : i, 0, last);
}

}  // namespace

cv::Mat splineOf(const cv::Mat& image) {
  cv::Mat c = image.clone();
  const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(c.step / sizeof(cv::Vec3f));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < c.rows; ++v) filterLine(c.ptr<cv::Vec3f>(v), c.cols, 1);
#pragma omp parallel for schedule(static)
  for (int u = 0; u < c.cols; ++u) filterLine(c.ptr<cv::Vec3f>(0) + u, c.rows, row);
  return c;
}

cv::Vec3f sampleSpline(const cv::Mat& coefficients, double u, double v) {
  const int i = cvFloor(u), j = cvFloor(v);
  const cv::Vec4f wu = weights(static_cast<float>(u - i)), wv = weights(static_cast<float>(v - j));
  cv::Vec3f sum;
  for (int b = 0; b < 4; ++b) {
    const cv::Vec3f* row = coefficients.ptr<cv::Vec3f>(mirrored(j - 1 + b, coefficients.rows));
    cv::Vec3f line;
    for (int a = 0; a < 4; ++a) line += wu[a] * row[mirrored(i - 1 + a, coefficients.cols)];
    sum += wv[b] * line;
  }
  return sum;
}

}  // namespace calipso::render
