#pragma once

#include "calipso_align/low_order_map.hpp"
#include "calipso_align/silhouette.hpp"

namespace calipso::align {

// What a finished fit's surface is expected to be off in 3D, in parts of the model's size.
struct ShapeUncertainty {
  double mean = 0.0;   // of the distance from the surface
  double rms = 0.0;
};

// Draws the parameters from their covariance, always the same ones, and measures how far points of the
// surfaces that they make are from the surface at x: a thin body that is off along its normal is still
// near its other side.
// covariance  of the parameters of `here`, which is the identity at x (camera frame)
// unseen      deviation along the sight line of what the parameters cannot follow, model sizes
ShapeUncertainty shapeUncertainty(const Points& x, const Triangles& triangles,
                                  const LowOrderMap& here, const Eigen::MatrixXd& covariance,
                                  double model_size, double unseen);

}  // namespace calipso::align
