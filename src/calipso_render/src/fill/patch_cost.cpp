#include "fill/patch_cost.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <type_traits>

#include "draw/side_by_side.hpp"
#include "fill/around_hole.hpp"

namespace calipso::render {
namespace {

constexpr float kNearer = 2.5f;  // times that a source may be nearer or farther
// cost of one that does not, squared code values: such are taken for want of others only
constexpr float kMisplaced = 2000.0f;
constexpr float kAsNear = 1.02f;  // times that a place may be nearer than a source as near as it
constexpr float kOffPattern = 0.75f;      // px by which a copy's way may miss the pattern
constexpr float kColourVaries = 250.0f;  // squared code values that are not off a colour
constexpr float kColourAround = 61.0f;    // px of the square that tells a place's colour
constexpr float kLivelier = 0.6f;  // part of its own gradients by which a source may have more

// CV_8UC1, != 0 where the patch around a pixel sees several surfaces; empty if none are known.
cv::Mat mixedPatches(const cv::Mat& surface) {
  if (surface.empty()) return {};
  const cv::Mat patch = cv::Mat::ones(kPatchSide, kPatchSide, CV_8U);
  cv::Mat lowest = surface.clone(), highest;
  lowest.setTo(255, surface == 0);
  cv::erode(lowest, lowest, patch), cv::dilate(surface, highest, patch);
  return (highest != 0) & (lowest != highest);
}

}  // namespace

std::vector<int> knownAround(const cv::Point& p, const cv::Mat& known, const cv::Mat& image) {
  const int row = static_cast<int>(image.step1());
  std::vector<int> seen;
  for (int dv = -kPatchRadius; dv <= kPatchRadius; ++dv) {
    for (int du = -kPatchRadius; du <= kPatchRadius; ++du) {
      if (known.at<std::uint8_t>(p + cv::Point(du, dv)) != 0)
        seen.push_back(dv * row + du * image.channels());
    }
  }
  return seen;
}

PatchCost::PatchCost(const FillLevel& level, float scale, float horizon, const Pattern& pattern,
                     const InpaintParams& params)
    : columns_(level.hole.cols),
      places_(level.hole.total()),
      scale_(scale),
      horizon_(horizon),
      pattern_(pattern.shrunk(scale, level.hole.rows)),
      repeats_(pattern.lattice || !pattern.periods.empty()),
      away_row_(params.away_row),
      away_column_(params.away_column),
      away_farther_(params.away_farther),
      off_colour_(params.off_colour),
      off_bland_(params.off_bland) {
  if (off_colour_ > 0.0f) {
    // Wider in the hole: a spot at its rim does not tell what is there.
    const int around = std::max(kPatchSide, cvRound(kColourAround / scale));
    const cv::Rect near = windowAround(level.hole, kPatchRadius, kPatchRadius);
    expected_ = cv::Mat(level.image.size(), level.image.type());
    doAll(true, {[&] {
                   cv::blur(level.image(near), expected_(near), {around, around});
                 },
                 [&] {
                   cv::blur(level.image, colours_, {kPatchSide, kPatchSide});
                 }});
  }
  const cv::Mat mixed = mixedPatches(level.surface);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < level.hole.rows; ++v) {
    Known* known = &places_[v * columns_];
    const auto take = [&](const cv::Mat& values, auto Known::*to) {
      using Value = std::remove_reference_t<decltype(known->*to)>;
      const Value* row = values.empty() ? nullptr : values.ptr<Value>(v);
      for (int u = 0; u < columns_ && row != nullptr; ++u) known[u].*to = row[u];
    };
    take(level.nearness, &Known::nearness);
    take(level.surface, &Known::surface);
    take(level.sky, &Known::sky);
    take(mixed, &Known::mixed);
  }
}

float PatchCost::distance(const cv::Mat& image, const cv::Mat& lively, const cv::Point& p,
                          const cv::Point& q, float bound) const {
  using Row = Eigen::Map<const Eigen::Array<float, 4 * kPatchSide, 1>>;
  float sum = awayCost(p, q);
  // Gradients do not make up for the wrong place.
  const float bland = blandCost(lively, p, q);
  if (bland > 0.0f || sum < kPatchSide * kPatchSide * kMisplaced) sum += bland;
  for (int dv = -kPatchRadius; dv <= kPatchRadius && sum < bound; ++dv) {
    const Row a(image.ptr<float>(p.y + dv) + 4 * (p.x - kPatchRadius)),
        b(image.ptr<float>(q.y + dv) + 4 * (q.x - kPatchRadius));
    sum += (a - b).square().sum();
  }
  return sum;
}

float PatchCost::partialDistance(const cv::Mat& image, const cv::Point& p, const cv::Point& q,
                                 const std::vector<int>& seen, float bound) const {
  using Pixel = Eigen::Map<const Eigen::Array4f>;
  const float away = awayCost(p, q), part = static_cast<float>(kPatchSide * kPatchSide) /
                                            std::max<std::size_t>(1, seen.size());
  const float *a = image.ptr<float>(p.y, p.x), *b = image.ptr<float>(q.y, q.x);
  Eigen::Array4f sums = Eigen::Array4f::Zero();
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (i % kPatchSide == 0 && part * sums.sum() + away >= bound) return bound;
    sums += (Pixel(a + seen[i]) - Pixel(b + seen[i])).square();
  }
  return part * sums.sum() + away;
}

// Places are layered: what is at another height is seldom the same, what is of another surface
// never.
inline float PatchCost::awayCost(const cv::Point& p, const cv::Point& q) const {
  float cost = scale_ * (away_row_ * std::abs(p.y - q.y) + away_column_ * std::abs(p.x - q.x));
  const Known &own = at(p), &other = at(q);
  if (other.nearness > kNearer * own.nearness + horizon_ ||
      own.nearness > kNearer * other.nearness + horizon_)
    cost += kMisplaced;
  if (away_farther_ > 0.0f && own.nearness > kAsNear * other.nearness && other.nearness > 0.0f)
    cost += away_farther_ * (own.nearness / other.nearness - kAsNear);
  if (differ(own.surface, other.surface)) cost += kMisplaced;
  if (differ(own.sky, other.sky)) cost += kMisplaced;
  if (repeats_ && isOffPattern(p, q)) cost += kMisplaced;
  if (off_colour_ > 0.0f) cost += off_colour_ * offColour(p, q);
  return kPatchSide * kPatchSide * cost;
}

// No lower than minus what the gradients' difference costs anyway, as its mean square is no less than
// the square of its mean. A mean over several surfaces tells of none.
inline float PatchCost::blandCost(const cv::Mat& lively, const cv::Point& p,
                                  const cv::Point& q) const {
  if (at(p).mixed != 0) return 0.0f;
  const float own = lively.at<float>(p), lack = own - lively.at<float>(q), most = kLivelier * own;
  return kPatchSide * kPatchSide * off_bland_ * std::max(lack * std::abs(lack), -most * most);
}

inline bool PatchCost::isOffPattern(const cv::Point& p, const cv::Point& q) const {
  const cv::Point2f shift(q - p);
  const auto whole = pattern_.nearest(p.y, shift);
  return whole && (shift - *whole).dot(shift - *whole) > kOffPattern * kOffPattern;
}

// Squared code values by which a copy would be off its place's colour.
float PatchCost::offColour(const cv::Point& p, const cv::Point& q) const {
  const cv::Vec4f off = expected_.at<cv::Vec4f>(p) - colours_.at<cv::Vec4f>(q);
  return std::max(0.0f, off[0] * off[0] + off[1] * off[1] + off[2] * off[2] - kColourVaries);
}

}  // namespace calipso::render
