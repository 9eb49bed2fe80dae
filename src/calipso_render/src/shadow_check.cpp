#include "shadow_check.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kReach = 10;        // px on either side of a border that are compared
constexpr int kPenumbra = 3;      // px at the border that are left out
constexpr int kMaskMargin = 3;    // px around objects that are left out
constexpr float kEnough = 0.08f;  // part of the compared square that each side must fill
constexpr std::size_t kFewest = 60;  // px of border
constexpr float kDarker = 0.93f;  // inside to outside, in linear light, from which a shadow is seen

cv::Mat disc(int radius) { return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}); }

// Mean of `values` where `side` is set, around every pixel, and how much of the square that is.
struct SideMean {
  cv::Mat mean, part;
  SideMean(const cv::Mat& values, const cv::Mat& side) {
    cv::Mat weight, weighted;
    side.convertTo(weight, CV_32F, 1.0 / 255.0);
    const cv::Size window(2 * kReach + 1, 2 * kReach + 1);
    cv::blur(weight, part, window, {-1, -1}, cv::BORDER_CONSTANT);
    cv::blur(values.mul(weight), weighted, window, {-1, -1}, cv::BORDER_CONSTANT);
    mean = weighted / cv::max(part, 1e-6);
  }
};

}  // namespace

cv::Mat seenShadows(const cv::Mat& predicted, const cv::Mat& picture, const cv::Mat& labels) {
  cv::Mat brightness(picture.size(), CV_32F), objects, inside, outside, border, parts;
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      const cv::Vec3f& c = picture.at<cv::Vec3f>(v, u);
      brightness.at<float>(v, u) = luminance({linearFromRealCode(c[0]), linearFromRealCode(c[1]), linearFromRealCode(c[2])});
    }
  }
  cv::dilate(labels != 0, objects, disc(kMaskMargin));
  cv::erode(predicted, inside, disc(kPenumbra));
  cv::dilate(predicted, outside, disc(kPenumbra));
  outside = outside == 0;
  inside.setTo(0, objects), outside.setTo(0, objects);
  cv::morphologyEx(predicted, border, cv::MORPH_GRADIENT, cv::Mat::ones(3, 3, CV_8U));
  const SideMean dark(brightness, inside), bright(brightness, outside);
  const int count = cv::connectedComponents(predicted, parts, 8, CV_32S);
  std::vector<std::vector<float>> ratios(count);
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      if (border.at<std::uint8_t>(v, u) == 0 || predicted.at<std::uint8_t>(v, u) == 0) continue;
      if (dark.part.at<float>(v, u) < kEnough || bright.part.at<float>(v, u) < kEnough) continue;
      ratios[parts.at<int>(v, u)].push_back(dark.mean.at<float>(v, u) / std::max(bright.mean.at<float>(v, u), 1e-4f));
    }
  }
  cv::Mat seen = predicted.clone();
  for (int part = 1; part < count; ++part) {
    std::vector<float>& r = ratios[part];
    if (r.size() < kFewest) continue;
    std::nth_element(r.begin(), r.begin() + r.size() / 2, r.end());
    if (r[r.size() / 2] > kDarker) seen.setTo(0, parts == part);
  }
  return seen;
}

}  // namespace calipso::render
