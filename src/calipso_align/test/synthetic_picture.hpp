#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>

namespace calipso::align::testing {

// Distance of pixel (u, v) from a shape's edge, px; negative inside.
using SignedDistance = std::function<double(double u, double v)>;

// A picture of `shape` in `fore` on `back`, its edge one pixel wide, with seeded noise of `noise`
// grey levels.
inline cv::Mat paint(const cv::Size& size, const SignedDistance& shape, const cv::Vec3b& fore,
                     const cv::Vec3b& back, double noise = 0.0, const cv::Mat& onto = {}) {
  cv::Mat image =
      onto.empty() ? cv::Mat(size, CV_8UC3, cv::Scalar(back[0], back[1], back[2])) : onto.clone();
  cv::RNG rng(7);
  for (int v = 0; v < size.height; ++v)
    for (int u = 0; u < size.width; ++u) {
      const double alpha = std::clamp(0.5 - shape(u, v), 0.0, 1.0);
      cv::Vec3b& pixel = image.at<cv::Vec3b>(v, u);
      for (int c = 0; c < 3; ++c)
        pixel[c] = cv::saturate_cast<uchar>(alpha * fore[c] + (1.0 - alpha) * pixel[c] +
                                            rng.gaussian(noise));
    }
  return image;
}

// 255 where the pixel's centre lies inside.
inline cv::Mat maskOf(const cv::Size& size, const SignedDistance& shape) {
  cv::Mat mask(size, CV_8U);
  for (int v = 0; v < size.height; ++v)
    for (int u = 0; u < size.width; ++u) mask.at<uchar>(v, u) = shape(u, v) < 0.0 ? 255 : 0;
  return mask;
}

inline SignedDistance disc(double u0, double v0, double radius) {
  return [=](double u, double v) { return std::hypot(u - u0, v - v0) - radius; };
}

inline SignedDistance box(double u0, double v0, double u1, double v1) {
  return [=](double u, double v) {
    return std::max(std::max(u0 - u, u - u1), std::max(v0 - v, v - v1));
  };
}

inline double intersectionOverUnion(const cv::Mat& a, const cv::Mat& b) {
  return cv::countNonZero(a & b) / static_cast<double>(std::max(1, cv::countNonZero(a | b)));
}

}  // namespace calipso::align::testing
