#pragma once

#include <opencv2/core.hpp>

namespace calipso::align {

// Area of the holes of `mask` that `other` has not, px: of those that somewhere are further than
// `tolerance_px` from their own rim and from all that `other` leaves open. Narrower ones cannot be
// told: a lattice's, or what is left of a hole that is seen almost edge-on.
// @param mask, other  255 inside, of the same size
double unshownHoles(const cv::Mat1b& mask, const cv::Mat1b& other, double tolerance_px);

// Mask without its holes.
cv::Mat1b withoutHoles(const cv::Mat1b& mask);

}  // namespace calipso::align
