#include "calipso_flow/look_match.hpp"

#include <opencv2/imgproc.hpp>

namespace calipso::flow {
namespace {

constexpr int kSurrounding = 16;  // px of the frame around the object's window; even

}  // namespace

LookMatch::Pyramid LookMatch::pyramidOf(const ImageWindow& window) {
  Pyramid pyramid{window, {{}, 0.5 * window.origin}};
  cv::pyrDown(window.image, pyramid.half.image);
  return pyramid;
}

LookMatch::LookMatch(const ReferenceView::Warped& look, const cv::Mat& picture)
    : look_(pyramidOf(look.gray)), weight_(pyramidOf(look.weight)) {
  const cv::Point origin(static_cast<int>(look.gray.origin.x),
                         static_cast<int>(look.gray.origin.y));
  // The frame around the object, at even pixels like the look.
  const cv::Rect around(origin - cv::Point(kSurrounding, kSurrounding),
                        look.gray.image.size() + cv::Size(2 * kSurrounding, 2 * kSurrounding));
  const cv::Rect inside = around & cv::Rect({0, 0}, picture.size());
  frame_ = pyramidOf({picture(inside), cv::Point2d(inside.tl())});
}

std::optional<PatchMatch> LookMatch::fine(const Eigen::Vector2d& at,
                                          const PatchParams& params) const {
  return matchPatch({look_.full, at, weight_.full, at}, frame_.full, at, params);
}

std::optional<PatchMatch> LookMatch::rough(const Eigen::Vector2d& at,
                                           const PatchParams& params) const {
  const Eigen::Vector2d half = 0.5 * at;
  auto rough = matchPatch({look_.half, half, weight_.half, half}, frame_.half, half, params);
  if (!rough) return std::nullopt;
  rough->position *= 2.0;
  rough->covariance *= 4.0;
  return rough;
}

std::optional<Eigen::Vector2d> LookMatch::missOnReturn(const Eigen::Vector2d& at,
                                                       const PatchMatch& there,
                                                       const PatchParams& params) const {
  const auto back =
      matchPatch({frame_.full, there.position, weight_.full, at}, look_.full, at, params);
  if (!back) return std::nullopt;
  return back->position - at;
}

}  // namespace calipso::flow
