#include "calipso_flow/look_match.hpp"

#include <Eigen/LU>
#include <cmath>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

namespace calipso::flow {
namespace {

constexpr int kSurrounding = 16;  // px of the frame around the object's window; even
constexpr double kStripes = 8;    // in which points are shared out
constexpr double kReturnDeviations = 3.0;
constexpr double kBlack = 4.0;           // grey levels: brightness below means nothing
constexpr double kStripeGradient = 2.0;  // grey levels per px; below, a direction is a stripe's

// Over a square, bilinear; nothing where it leaves the picture.
std::optional<double> meanAround(const ImageWindow& window, const Eigen::Vector2d& at, int radius) {
  const double x = at.x() - window.origin.x - radius, y = at.y() - window.origin.y - radius;
  const int side = 2 * radius + 1;
  if (!(x >= 0.0 && y >= 0.0 && x < window.image.cols - side && y < window.image.rows - side))
    return std::nullopt;
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const double right = x - x0, down = y - y0;
  double sum = 0.0;
  for (int v = 0; v <= side; ++v) {
    const float* row = window.image.ptr<float>(y0 + v) + x0;
    double line = (1.0 - right) * row[0] + right * row[side];
    for (int u = 1; u < side; ++u) line += row[u];
    sum += (v == 0 ? 1.0 - down : v == side ? down : 1.0) * line;
  }
  return sum / (side * side);
}

ImageWindow halved(const ImageWindow& window) {
  ImageWindow half{{}, 0.5 * window.origin};
  cv::pyrDown(window.image, half.image);
  return half;
}

}  // namespace

PatchParams stripePatches(PatchParams params) {
  params.least_gradient = kStripeGradient;
  params.stripes = true;
  return params;
}

LookMatch::LookMatch(const ReferenceView::Warped& look, const cv::Mat& picture, Care care)
    : care_(care),
      scale_(care == Care::kRough ? 0.5 : 1.0),
      look_(look.gray),
      weight_(look.weight) {
  const cv::Point origin(static_cast<int>(look.gray.origin.x),
                         static_cast<int>(look.gray.origin.y));
  // The frame around the object, at even pixels like the look.
  const cv::Rect around(origin - cv::Point(kSurrounding, kSurrounding),
                        look.gray.image.size() + cv::Size(2 * kSurrounding, 2 * kSurrounding));
  const cv::Rect inside = around & cv::Rect({0, 0}, picture.size());
  frame_ = {picture(inside), cv::Point2d(inside.tl())};
  if (care != Care::kRough) return;
  look_ = halved(look_);
  weight_ = halved(weight_);
  frame_ = halved(frame_);
}

std::optional<PatchMatch> LookMatch::find(const Seed& seed, const PatchParams& params) const {
  const Eigen::Vector2d at = scale_ * seed.at;
  auto match = matchPatch({look_, at, weight_, at}, frame_, scale_ * seed.expected, params);
  if (!match) return std::nullopt;
  match->position /= scale_;
  match->covariance /= scale_ * scale_;
  match->deviation /= scale_;
  return match;
}

std::optional<PatchMatch> LookMatch::findSurely(const Seed& seed, const PatchParams& params,
                                                const MatchTrust& trust) const {
  auto there = find(seed, params);
  // A patch that is uncertain in one direction may be certain in the other.
  const bool wanders = !there || there->deviation > trust.largest_deviation_px;
  if (wanders && care_ != Care::kRough && !params.stripes)
    return findSurely(seed, stripePatches(params), trust);
  if (!there || there->correlation < trust.least_correlation) return std::nullopt;
  if (care_ == Care::kRough) return there;
  // A patch counts when it is certain in one direction at least; the other is weighted by its own
  // uncertainty.
  if (there->deviation > trust.largest_deviation_px) return std::nullopt;
  if (care_ == Care::kForward) return there;
  const auto miss = missOnReturn(seed.at, *there, params);
  if (!miss) return std::nullopt;
  const double floor = trust.forward_backward_px / kReturnDeviations;
  const Eigen::Matrix2d allowed = there->covariance + floor * floor * Eigen::Matrix2d::Identity();
  if (miss->dot(allowed.inverse() * *miss) > kReturnDeviations * kReturnDeviations)
    return std::nullopt;
  return there;
}

LookMatch::Matches LookMatch::forEach(const std::vector<Seed>& seeds, const Search& search) {
  Matches matches(seeds.size());
  cv::parallel_for_(
      {0, static_cast<int>(seeds.size())},
      [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i) matches[i] = search(seeds[i]);
      },
      kStripes);
  return matches;
}

std::optional<double> LookMatch::brightening(const Seed& seed, const PatchMatch& match,
                                             int radius_px) const {
  const auto known = meanAround(weight_, scale_ * seed.at, radius_px);
  const auto before = meanAround(look_, scale_ * seed.at, radius_px);
  const auto now = meanAround(frame_, scale_ * match.position, radius_px);
  if (!known || !before || !now || *known < 1.0 - 1e-6) return std::nullopt;
  return std::log((*now + kBlack) / (*before + kBlack));
}

std::optional<Eigen::Vector2d> LookMatch::missOnReturn(const Eigen::Vector2d& at,
                                                       const PatchMatch& there,
                                                       const PatchParams& params) const {
  const Eigen::Vector2d scaled = scale_ * at;
  const auto back =
      matchPatch({frame_, scale_ * there.position, weight_, scaled}, look_, scaled, params);
  if (!back) return std::nullopt;
  return Eigen::Vector2d(back->position / scale_ - at);
}

}  // namespace calipso::flow
