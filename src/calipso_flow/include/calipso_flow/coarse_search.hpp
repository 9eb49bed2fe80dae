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

}  // namespace calipso::flow
