#include "place/haze.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "calipso_render/colour.hpp"
#include "place/key_cover.hpp"
#include "place/masked_quantile.hpp"

namespace calipso::render {
namespace {

constexpr int kHorizon = 8;             // px of sky above what is seen before it
constexpr float kRange = 1.25f;         // of distance, that is looked at together
constexpr std::size_t kFewest = 200;    // px in it
constexpr float kDarkest = 0.01f;       // part of them that is darkest
constexpr float kExplained = 2.0f;      // times as dark as the law has it
constexpr float kMostly = 2.0f / 3.0f;  // of the ranges
constexpr float kLeastSpan = 3.0f;      // from the nearest to the farthest of them
constexpr float kMostAdded = 0.9f;      // of what is seen: the rest is what the noise leaves

struct Range {
  float distance, darkest;
};

std::vector<Range> rangesOf(const cv::Mat& linear, const cv::Mat& nearness) {
  std::map<int, std::vector<float>> values;
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u) {
      const float near = nearness.at<float>(v, u);
      if (near > 0.0f)
        values[static_cast<int>(std::floor(-std::log(near) / std::log(kRange)))].push_back(
            luminance(linear.at<cv::Vec3f>(v, u)));
    }
  }
  std::vector<Range> ranges;
  for (auto& [number, of] : values) {
    if (of.size() < kFewest) continue;
    const auto nth = of.begin() + static_cast<std::ptrdiff_t>(kDarkest * of.size());
    std::nth_element(of.begin(), nth, of.end());
    ranges.push_back({std::pow(kRange, number + 0.5f), *nth});
  }
  return ranges;
}

}  // namespace

Haze::Haze(const cv::Mat& picture, const cv::Mat& nearness, const cv::Mat& sky) {
  if (nearness.empty() || cv::countNonZero(sky) == 0) return;
  const cv::Mat linear = linearFromRealCodes(picture),
                horizon = sky & grown(nearness > 0.0f, kHorizon);
  if (cv::countNonZero(horizon) < static_cast<int>(kFewest)) return;
  cv::Mat colours[3];
  cv::split(linear, colours);
  for (int c = 0; c < 3; ++c) air_[c] = quantileOf(colours[c], horizon, 0.5);
  const float air = luminance(air_);
  const std::vector<Range> ranges = rangesOf(linear, nearness);
  if (ranges.empty() || ranges.back().distance < kLeastSpan * ranges.front().distance) return;
  // Nothing is darker than the haze before it.
  float extinction = std::numeric_limits<float>::infinity();
  for (const Range& r : ranges) {
    if (r.darkest < air)
      extinction = std::min(extinction, -std::log(1.0f - r.darkest / air) / r.distance);
  }
  if (!std::isfinite(extinction)) return;
  const auto explained = std::count_if(ranges.begin(), ranges.end(), [&](const Range& r) {
    return r.darkest < kExplained * air * (1.0f - std::exp(-extinction * r.distance));
  });
  if (static_cast<float>(explained) >= kMostly * static_cast<float>(ranges.size()))
    extinction_ = extinction;
}

cv::Vec3f Haze::addedAt(float nearness) const {
  if (!established()) return {};
  return nearness > 0.0f ? air_ * (1.0f - std::exp(-extinction_ / nearness)) : air_;
}

cv::Mat withoutHaze(const Haze& haze, const cv::Mat& picture, const cv::Mat& nearness) {
  if (!haze.established()) return picture;
  cv::Mat clear = picture.clone();
  for (int v = 0; v < clear.rows; ++v) {
    for (int u = 0; u < clear.cols; ++u) {
      const cv::Vec3f added = haze.addedAt(nearness.at<float>(v, u));
      cv::Vec3f& code = clear.at<cv::Vec3f>(v, u);
      for (int c = 0; c < 3; ++c) {
        const float seen = linearFromRealCode(code[c]);
        code[c] = codeFromLinear(seen - std::min(added[c], kMostAdded * seen));
      }
    }
  }
  return clear;
}

cv::Mat veilOf(const Haze& haze, const cv::Mat& plate_linear, const cv::Mat& nearness) {
  if (!haze.established()) return {};
  cv::Mat veil(plate_linear.size(), CV_8U);
  for (int v = 0; v < veil.rows; ++v) {
    for (int u = 0; u < veil.cols; ++u) {
      const float seen = luminance(plate_linear.at<cv::Vec3f>(v, u)),
                  added = luminance(haze.addedAt(nearness.at<float>(v, u)));
      veil.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(
          255.0f * std::min(kMostAdded, added / std::max(seen, 1e-4f)) + 0.5f);
    }
  }
  return veil;
}

}  // namespace calipso::render
