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

namespace {

// Sums over a window around every pixel of what a mask lets through, of which the light is read: it
// changes slowly, so that half the resolution tells it in a large view.
struct LightSums {
  cv::Mat from, to;  // CV_32FC3
  float faint;       // one grey level all over the window
};

LightSums lightSums(const cv::Mat& image, const cv::Mat& other, const cv::Mat& same) {
  constexpr int kWindow = 13;        // px
  constexpr int kLargeView = 40000;  // px^2
  cv::Mat here = cv::Mat::zeros(image.size(), CV_8UC3), there = here.clone();
  image.copyTo(here, same);
  other.copyTo(there, same);
  const bool large = image.size().area() > kLargeView;
  if (large) {
    cv::resize(here, here, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
    cv::resize(there, there, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  }
  const int window = large ? kWindow / 2 + 1 : kWindow;
  LightSums sums{{}, {}, static_cast<float>(window * window)};
  cv::boxFilter(here, sums.from, CV_32F, {window, window}, cv::Point(-1, -1), false);
  cv::boxFilter(there, sums.to, CV_32F, {window, window}, cv::Point(-1, -1), false);
  return sums;
}

}  // namespace

cv::Mat relit(const cv::Mat& image, const cv::Mat& other, const cv::Mat& same) {
  const LightSums sums = lightSums(image, other, same);
  cv::Mat factor(sums.from.size(), CV_32FC3);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < factor.rows; ++y) {
    const cv::Vec3f *a = sums.from.ptr<cv::Vec3f>(y), *b = sums.to.ptr<cv::Vec3f>(y);
    cv::Vec3f* out = factor.ptr<cv::Vec3f>(y);
    for (int x = 0; x < factor.cols; ++x)
      for (int c = 0; c < 3; ++c)
        out[x][c] = std::clamp((b[x][c] + sums.faint) / (a[x][c] + sums.faint), 0.3f, 3.0f);
  }
  if (factor.size() != image.size()) cv::resize(factor, factor, image.size());
  cv::Mat result;
  cv::multiply(image, factor, result, 1.0, CV_8U);
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

namespace {

constexpr float kDarkest = 0.3f, kLightest = 0.97f;  // of a shadow, in the picture's own gamma
constexpr float kDeep = 0.92f;                       // darker than this: no change of exposure
// of what a shadow takes in brightness: the sky that still lights it
constexpr float kTint = 0.05f;

// What is left of a colour when the shadow that comes closest is put on it.
struct Darkened {
  float factor, squared_rest, tint;  // tint: how far off the rest may be, grey levels
};

Darkened darkened(const cv::Vec3f& lit, const cv::Vec3f& seen) {
  const float squared = std::max(1.0f, lit.dot(lit));
  const float s = seen.dot(lit) / squared;
  const cv::Vec3f rest = seen - std::clamp(s, kDarkest, kLightest) * lit;
  return {s, rest.dot(rest), kTint * std::max(0.0f, 1.0f - s) * std::sqrt(squared)};
}

// Whether a shadow that is one for certain would darken the one colour to about the other's
// brightness.
bool isDarkerBy(const cv::Vec3f& lit, const cv::Vec3f& seen) {
  const float squared = std::max(1.0f, lit.dot(lit)), along = seen.dot(lit);
  return along >= kDarkest * squared && along <= kDeep * squared;
}

}  // namespace

bool isShadowed(const cv::Vec3f& lit, const cv::Vec3f& seen, double noise) {
  if (!isDarkerBy(lit, seen)) return false;
  const Darkened d = darkened(lit, seen);
  return d.squared_rest <= static_cast<float>(9.0 * noise * noise) + 4.0f * d.tint * d.tint;
}

// Uniform over the factors that a shadow darkens by, Student's t across the line from black to the
// colour: the sky that still lights a shadow has another tint than the sun.
float shadowCost(const cv::Vec3f& lit, const cv::Vec3f& seen, double noise) {
  constexpr float kFreedom = 3.0f,
                  kNormaliser = 1.84f;  // -log of the density's constant in the plane
  const Darkened d = darkened(lit, seen);
  const float variance = static_cast<float>(noise * noise) + d.tint * d.tint;
  return kNormaliser + std::log(variance) +
         0.5f * (kFreedom + 2.0f) * std::log1p(d.squared_rest / (kFreedom * variance)) +
         std::log((kLightest - kDarkest) * std::max(1.0f, static_cast<float>(cv::norm(lit))));
}

float Shadow::cost(const cv::Vec3f& seen, int x, int y) const {
  if (colour.empty()) return kForbidden;
  const float likely = share.at<uchar>(y, x) / 255.0f;
  if (!(likely > 0.0f)) return kForbidden;
  return shadowCost(cv::Vec3f(colour.at<cv::Vec3b>(y, x)), seen, noise) - std::log(likely);
}

Shadow shadowOn(const cv::Mat& background, const cv::Mat& view, const cv::Mat& clear, double noise,
                const std::vector<const GaussianMixture*>& object) {
  const cv::Size kWindow(21, 21);    // px
  constexpr double kChance = 0.002;  // of the clear pixels: so few look shaded without any shadow
  constexpr float kFewest = 0.02f;   // share of the window that must be clear
  Shadow shadow{background, cv::Mat(view.size(), CV_8U, cv::Scalar(255)), noise};
  const auto isShaded = [&](int x, int y) {
    const cv::Vec3f colour(view.at<cv::Vec3b>(y, x));
    if (!isShadowed(background.at<cv::Vec3b>(y, x), colour, noise)) return false;
    const float cost = shadow.cost(colour, x, y);
    return std::all_of(object.begin(), object.end(), [&](const GaussianMixture* colours) {
      return colours->cost(colour) > cost;
    });
  };
  cv::Mat seen, shaded(view.size(), CV_32F, cv::Scalar(0));
  cv::Mat(clear > 0).convertTo(seen, CV_32F, 1.0 / 255.0);
#pragma omp parallel for schedule(dynamic, 16)
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x)
      if (clear.at<uchar>(y, x) && isShaded(x, y)) shaded.at<float>(y, x) = 1.0f;
  shadow.share.setTo(0);
  if (cv::sum(shaded)[0] < kChance * cv::sum(seen)[0]) return shadow;
  cv::boxFilter(seen, seen, CV_32F, kWindow);
  cv::boxFilter(shaded, shaded, CV_32F, kWindow);
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x)
      if (seen.at<float>(y, x) > kFewest)
        shadow.share.at<uchar>(y, x) =
            cv::saturate_cast<uchar>(255.0f * shaded.at<float>(y, x) / seen.at<float>(y, x));
  return shadow;
}

float LayerAppearance::cost(const cv::Vec3f& seen, int x, int y, float outlier_cost) const {
  constexpr float kUnforeseen = 0.05f, kLeast = 0.02f;  // shares of what no account explains
  float likely = 0.0f, best = kForbidden;
  for (const Expectation& account : accounts) {
    likely += account.factor * account.share.at<uchar>(y, x) / 255.0f;
    best = std::min(best, account.cost(seen, x, y));
  }
  best = std::min(best, shadow.cost(seen, x, y));
  float anything = outlier_cost;
  for (const GaussianMixture* mixture : colours) anything = std::min(anything, mixture->cost(seen));
  return std::min(best, anything - std::log(kUnforeseen * std::max(kLeast, 1.0f - likely)));
}

}  // namespace calipso::align
