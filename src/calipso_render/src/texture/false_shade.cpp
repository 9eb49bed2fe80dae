#include "texture/false_shade.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kAround = 31;  // px: side of the square in which pixels are compared
constexpr float kBrighter = 1.1f;
constexpr float kShaded = 0.7f;  // of the light in the open: what has less lies in cast shade

cv::Mat brightnessOf(const cv::Mat& colour) {
  cv::Mat brightness(colour.size(), CV_32F);
  for (int v = 0; v < colour.rows; ++v) {
    for (int u = 0; u < colour.cols; ++u)
      brightness.at<float>(v, u) = luminance(colour.at<cv::Vec3f>(v, u));
  }
  return brightness;
}

}  // namespace

void takeOutFalseShade(const SurfaceLight& seen, const cv::Vec3f& floor, cv::Mat& albedo) {
  const cv::Mat brightness = brightnessOf(albedo);
  cv::Mat most = cv::Mat::zeros(albedo.size(), CV_32F);
  brightness.copyTo(most, seen.certain);
  cv::dilate(most, most, cv::Mat::ones(kAround, kAround, CV_8U));
  for (int v = 0; v < albedo.rows; ++v) {
    for (int u = 0; u < albedo.cols; ++u) {
      const float highest = most.at<float>(v, u);
      const cv::Vec3f &light = seen.now.at<cv::Vec3f>(v, u), &open = seen.open.at<cv::Vec3f>(v, u);
      if (highest <= 0.0f || brightness.at<float>(v, u) <= kBrighter * highest ||
          luminance(light) >= kShaded * luminance(open))
        continue;
      cv::Vec3f& c = albedo.at<cv::Vec3f>(v, u);
      for (int i = 0; i < 3; ++i) c[i] *= (light[i] + floor[i]) / (open[i] + floor[i]);
      c *= std::min(1.0f, highest / luminance(c));
    }
  }
}

}  // namespace calipso::render
