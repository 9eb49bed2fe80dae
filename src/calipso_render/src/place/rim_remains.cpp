#include "place/rim_remains.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "place/key_cover.hpp"

namespace calipso::render {
namespace {

constexpr int kRim = 3;           // px beyond the margin in which something may remain
constexpr int kBeside = 10;       // px beyond that, of what is around
constexpr int kLooked = 7;        // px around a remain in which nothing may look like it
constexpr float kUnlike = 18.0f;  // code values, in one channel

float unlikeness(const cv::Vec3f& a, const cv::Vec3f& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

// Is nothing around like it, though something is seen there?
bool isForeign(const cv::Mat& picture, const cv::Mat& around, const cv::Point& p) {
  const cv::Rect box = cv::Rect(p.x - kLooked, p.y - kLooked, 2 * kLooked + 1, 2 * kLooked + 1) &
                       cv::Rect({0, 0}, picture.size());
  const cv::Vec3f own = picture.at<cv::Vec3f>(p);
  bool any = false;
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      if (around.at<std::uint8_t>(v, u) == 0) continue;
      if (unlikeness(picture.at<cv::Vec3f>(v, u), own) <= kUnlike) return false;
      any = true;
    }
  }
  return any;
}

}  // namespace

cv::Mat rimRemains(const cv::Mat& picture, const cv::Mat& footprint, const cv::Mat& others,
                   int margin) {
  const cv::Mat own = grown(footprint, margin), with_rim = grown(footprint, margin + kRim),
                not_others = grown(others, margin) == 0,
                around = grown(footprint, margin + kRim + kBeside) & ~with_rim & not_others;
  std::vector<cv::Point> rim;
  cv::findNonZero(with_rim & ~own & not_others, rim);
  cv::Mat remains = cv::Mat::zeros(footprint.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 64)
  for (std::size_t i = 0; i < rim.size(); ++i) {
    if (isForeign(picture, around, rim[i])) remains.at<std::uint8_t>(rim[i]) = 255;
  }
  cv::Mat reached = own.clone();  // what hangs together with the footprint
  for (int i = 0; i < kRim; ++i) {
    cv::dilate(reached, reached, cv::Mat::ones(3, 3, CV_8U));
    reached &= own | remains;
  }
  return remains & reached;
}

}  // namespace calipso::render
