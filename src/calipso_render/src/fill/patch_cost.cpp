#include "fill/patch_cost.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

constexpr float kNearer = 2.5f;  // times that a source may be nearer or farther
// cost of one that does not, squared code values: such are taken for want of others only
constexpr float kMisplaced = 2000.0f;
constexpr float kAsNear = 1.02f;  // times that a place may be nearer than a source as near as it
constexpr float kOffLattice = 0.75f;  // px by which a copy's way may miss the lattice

}  // namespace

PatchCost::PatchCost(const FillLevel& level, float scale, float horizon, const Lattice* lattice,
                     const InpaintParams& params)
    : nearness_(level.nearness),
      surface_(level.surface),
      sky_(level.sky),
      has_nearness_(!nearness_.empty()),
      has_surface_(!surface_.empty()),
      has_sky_(!sky_.empty()),
      scale_(scale),
      horizon_(horizon),
      lattice_(lattice),
      away_row_(params.away_row),
      away_column_(params.away_column),
      away_farther_(params.away_farther) {}

float PatchCost::distance(const cv::Mat& image, const cv::Point& p, const cv::Point& q,
                          float bound) const {
  using Row = Eigen::Map<const Eigen::Array<float, 4 * kPatchSide, 1>>;
  float sum = awayCost(p, q);
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

cv::Point PatchCost::onLattice(const cv::Point& p, const cv::Point& q) const {
  if (lattice_ == nullptr) return q;
  const cv::Point2f whole = lattice_->nearest(scale_ * cv::Point2f(q - p));
  return p + cv::Point(cvRound(whole.x / scale_), cvRound(whole.y / scale_));
}

// Places are layered: what is at another height is seldom the same, what is of another surface
// never.
float PatchCost::awayCost(const cv::Point& p, const cv::Point& q) const {
  float cost = scale_ * (away_row_ * std::abs(p.y - q.y) + away_column_ * std::abs(p.x - q.x));
  if (has_nearness_) {
    const float own = nearness_.at<float>(p), other = nearness_.at<float>(q);
    if (other > kNearer * own + horizon_ || own > kNearer * other + horizon_) cost += kMisplaced;
    if (away_farther_ > 0.0f && own > kAsNear * other && other > 0.0f)
      cost += away_farther_ * (own / other - kAsNear);
  }
  if (onOther(p, q)) cost += kMisplaced;
  if (has_sky_ && differ(sky_, p, q)) cost += kMisplaced;
  if (lattice_ != nullptr && offLattice(q - p) > kOffLattice) cost += kMisplaced;
  return kPatchSide * kPatchSide * cost;
}

// px of this level by which a shift misses the lattice
float PatchCost::offLattice(const cv::Point& shift) const {
  const cv::Point2f fine = scale_ * cv::Point2f(shift);
  return static_cast<float>(cv::norm(fine - lattice_->nearest(fine))) / scale_;
}

}  // namespace calipso::render
