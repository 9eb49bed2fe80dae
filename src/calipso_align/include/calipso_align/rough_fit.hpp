#pragma once

#include "calipso_align/fit_problem.hpp"
#include "calipso_align/low_order_map.hpp"

namespace calipso::align {

// How well the rough placement can be started from.
struct RoughCheck {
  bool usable = true;
  std::string reason;  // what is wrong with it, and what to do
};

// Whether the placement is in front of the camera, on the picture, and of the contour's size.
RoughCheck checkPlacement(const FitProblem& problem);

// Shifts and scales the model so that the centroid and the area of its silhouette are those of the
// contour, at the depth that the depth image has for it. Where much of the contour is unknown,
// areas cannot be compared: then the model is shifted to where the depth image lets it be.
void placeRoughly(const FitProblem& problem, LowOrderMap& map);

}  // namespace calipso::align
