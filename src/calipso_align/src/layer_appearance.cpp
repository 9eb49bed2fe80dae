#include "layer_appearance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/label_cut.hpp"

namespace calipso::align {

double noiseOf(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  constexpr double kLeast = 2.0;  // grey levels: quantisation and compression
  constexpr int kStride = 2;      // every other pixel and row tells a median well enough
  std::array<int, 256> histogram = {};
  int total = 0;
  if (!b.empty())
    for (int y = 0; y < mask.rows; y += kStride)
      for (int x = 0; x < mask.cols; x += kStride) {
        if (!mask.at<uchar>(y, x)) continue;
        const cv::Vec3b p = a.at<cv::Vec3b>(y, x), q = b.at<cv::Vec3b>(y, x);
        for (int c = 0; c < 3; ++c) ++histogram[std::abs(p[c] - q[c])];
        total += 3;
      }
  int median = 0, below = histogram[0];
  while (2 * below < total) below += histogram[++median];
  return std::max(kLeast, 1.4826 * median);
}

cv::Mat relit(const cv::Mat& image, const cv::Mat& other, const cv::Mat& same) {
  const cv::Size kWindow(13, 13);  // px; light changes slowly
  const float kFaint = static_cast<float>(kWindow.area());  // one grey level all over the window
  cv::Mat here = cv::Mat::zeros(image.size(), CV_8UC3), there = here.clone(), from, to;
  image.copyTo(here, same);
  other.copyTo(there, same);
  cv::boxFilter(here, from, CV_32F, kWindow, cv::Point(-1, -1), false);
  cv::boxFilter(there, to, CV_32F, kWindow, cv::Point(-1, -1), false);
  cv::Mat result(image.size(), CV_8UC3);
  for (int y = 0; y < result.rows; ++y) {
    const cv::Vec3b* in = image.ptr<cv::Vec3b>(y);
    const cv::Vec3f *a = from.ptr<cv::Vec3f>(y), *b = to.ptr<cv::Vec3f>(y);
    cv::Vec3b* out = result.ptr<cv::Vec3b>(y);
    for (int x = 0; x < result.cols; ++x)
      for (int c = 0; c < 3; ++c)
        out[x][c] = cv::saturate_cast<uchar>(
            in[x][c] * std::clamp((b[x][c] + kFaint) / (a[x][c] + kFaint), 0.3f, 3.0f));
  }
  return result;
}

// Student's t: now and then motion is off or light has changed, and more than noise differs.
float Expectation::cost(const cv::Vec3f& seen, int x, int y) const {
  constexpr float kFreedom = 3.0f, kNormaliser = 3.12f;  // -log of its density's constant
  const float likely = factor * share.at<uchar>(y, x) / 255.0f;
  if (!(likely > 0.0f)) return kForbidden;
  const cv::Vec3f d = seen - cv::Vec3f(colour.at<cv::Vec3b>(y, x));
  const float variance = static_cast<float>(noise * noise);
  return kNormaliser + 1.5f * std::log(variance) +
         0.5f * (kFreedom + 3.0f) * std::log1p(d.dot(d) / (kFreedom * variance)) - std::log(likely);
}

float LayerAppearance::cost(const cv::Vec3f& seen, int x, int y, float outlier_cost) const {
  constexpr float kUnforeseen = 0.05f, kLeast = 0.02f;  // shares of what no account explains
  float likely = 0.0f, best = kForbidden;
  for (const Expectation& account : accounts) {
    likely += account.factor * account.share.at<uchar>(y, x) / 255.0f;
    best = std::min(best, account.cost(seen, x, y));
  }
  float anything = outlier_cost;
  for (const GaussianMixture* mixture : colours) anything = std::min(anything, mixture->cost(seen));
  return std::min(best, anything - std::log(kUnforeseen * std::max(kLeast, 1.0f - likely)));
}

}  // namespace calipso::align
