#pragma once

#include <Eigen/Core>

#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

// Displacement in pixels that brings the warped look of an object onto the picture, found by
// masked, normalised correlation at reduced size. Zero when nowhere is clearly better than the
// prediction.
// @param reach  px by which the object may lie off in u (left, right) and v (up, down)
Eigen::Vector2d coarseDisplacement(const ReferenceView::Warped& look, const cv::Mat& picture,
                                   const Eigen::AlignedBox2d& reach);

// Normalised correlation of the look with the picture where the look lies; -1: nothing to tell by.
double correlationInPlace(const ReferenceView::Warped& look, const cv::Mat& picture);

// The best place within reach, however it compares with the prediction.
struct CoarseMatch {
  Eigen::Vector2d displacement = Eigen::Vector2d::Zero();  // px
  double correlation = -1.0;  // there; -1: too small or too flat to tell
  double at_home = -1.0;      // where it was predicted
};
// @param factor  by which look and picture are reduced first
CoarseMatch matchCoarsely(const ReferenceView::Warped& look, const cv::Mat& picture,
                          const Eigen::AlignedBox2d& reach, int factor);

}  // namespace calipso::flow
