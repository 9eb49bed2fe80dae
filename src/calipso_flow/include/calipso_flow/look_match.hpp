#pragma once

#include <optional>

#include "calipso_flow/patch_match.hpp"
#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

// The warped look of an object and the frame it is to be found in, at full and at half size.
class LookMatch {
 public:
  // @param picture  CV_32F, the whole frame
  LookMatch(const ReferenceView::Warped& look, const cv::Mat& picture);

  // Where the patch of the look around `at` is found in the frame.
  std::optional<PatchMatch> fine(const Eigen::Vector2d& at, const PatchParams& params) const;
  // The same at half size, in coordinates of the full size: reaches far, but is not precise.
  std::optional<PatchMatch> rough(const Eigen::Vector2d& at, const PatchParams& params) const;
  // By how much the match, followed back into the look, misses the point where it began.
  std::optional<Eigen::Vector2d> missOnReturn(const Eigen::Vector2d& at, const PatchMatch& there,
                                              const PatchParams& params) const;

 private:
  struct Pyramid {
    ImageWindow full, half;
  };
  static Pyramid pyramidOf(const ImageWindow& window);

  Pyramid look_, weight_, frame_;
};

}  // namespace calipso::flow
