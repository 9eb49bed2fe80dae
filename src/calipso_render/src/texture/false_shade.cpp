#include "texture/false_shade.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr float kStep = 2.0f;     // px: of depth, from which neighbours are not one surface
constexpr int kBeside = 2;        // px from an inner outline that a fit may be off by
constexpr int kAround = 31;       // px: side of the square in which pixels are compared
constexpr float kCertain = 0.9f;  // trust of what others are compared with
constexpr float kBrighter = 1.1f;
constexpr float kShaded = 0.7f;  // of the light in the open: what has less lies in cast shade

bool onObject(const cv::Vec3f& normal) { return normal.dot(normal) > 0.0f; }

// Whether two neighbours lie on surfaces of which one hides the other's continuation.
bool outlineBetween(const SurfacePicture& s, const cv::Point& a, const cv::Point& b, float step) {
  const cv::Vec3f &m = s.normal.at<cv::Vec3f>(a), &n = s.normal.at<cv::Vec3f>(b);
  if (!onObject(m) || !onObject(n)) return false;
  const cv::Vec3f way = s.position.at<cv::Vec3f>(b) - s.position.at<cv::Vec3f>(a);
  return std::min(std::abs(m.dot(way)), std::abs(n.dot(way))) > step;
}

// CV_8U: 255 within kBeside px of an inner outline.
cv::Mat besideOutlines(const SurfacePicture& s, float step) {
  cv::Mat beside = cv::Mat::zeros(s.normal.size(), CV_8U);
  for (int v = 0; v < beside.rows; ++v) {
    for (int u = 0; u < beside.cols; ++u) {
      const cv::Point here(u, v);
      for (const cv::Point& next : {cv::Point(u + 1, v), cv::Point(u, v + 1)}) {
        if (next.x < beside.cols && next.y < beside.rows && outlineBetween(s, here, next, step))
          beside.at<uchar>(here) = beside.at<uchar>(next) = 255;
      }
    }
  }
  const int side = 2 * kBeside - 1;
  cv::dilate(beside, beside, cv::Mat::ones(side, side, CV_8U));
  return beside;
}

cv::Mat brightnessOf(const cv::Mat& colour) {
  cv::Mat brightness(colour.size(), CV_32F);
  for (int v = 0; v < colour.rows; ++v) {
    for (int u = 0; u < colour.cols; ++u)
      brightness.at<float>(v, u) = luminance(colour.at<cv::Vec3f>(v, u));
  }
  return brightness;
}

}  // namespace

void takeOutFalseShade(const SurfacePicture& seen, const cv::Vec3f& floor, float pixel,
                       cv::Mat& albedo) {
  const cv::Mat certain = (seen.trust >= kCertain) & (besideOutlines(seen, kStep * pixel) == 0);
  const cv::Mat brightness = brightnessOf(albedo);
  cv::Mat most = cv::Mat::zeros(albedo.size(), CV_32F);
  brightness.copyTo(most, certain);
  cv::dilate(most, most, cv::Mat::ones(kAround, kAround, CV_8U));
  for (int v = 0; v < albedo.rows; ++v) {
    for (int u = 0; u < albedo.cols; ++u) {
      const float highest = most.at<float>(v, u);
      const cv::Vec3f &light = seen.light.at<cv::Vec3f>(v, u),
                      &open = seen.open.at<cv::Vec3f>(v, u);
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
