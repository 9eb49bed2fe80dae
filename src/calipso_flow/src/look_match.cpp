#include "calipso_flow/look_match.hpp"

#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

namespace calipso::flow {
namespace {

constexpr int kSurrounding = 16;  // px of the frame around the object's window; even
constexpr double kStripes = 8;    // in which points are shared out

ImageWindow halved(const ImageWindow& window) {
  ImageWindow half{{}, 0.5 * window.origin};
  cv::pyrDown(window.image, half.image);
  return half;
}

}  // namespace

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
  return match;
}

LookMatch::Matches LookMatch::forEach(const std::vector<Seed>& seeds, const Search& search) {
  Matches matches(seeds.size());
  cv::parallel_for_({0, static_cast<int>(seeds.size())}, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) matches[i] = search(seeds[i]);
  }, kStripes);
  return matches;
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
