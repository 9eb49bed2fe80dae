#pragma once

#include <functional>
#include <vector>

#include "calipso_align/low_order_map.hpp"
#include "calipso_align/silhouette.hpp"

namespace calipso::align {

// How far a surface is from another one, in parts of the model's size.
struct SurfaceDistance {
  double mean = 0.0;
  double rms = 0.0;
};

// What a finished fit's surface may be off in 3D: one distance per surface that may be the true
// one.
struct ShapeUncertainty {
  std::vector<SurfaceDistance> draws;
  // The same surfaces with the scale about the camera's centre taken out, which no picture shows:
  // what is left is the shape's.
  std::vector<SurfaceDistance> without_distance;
  std::vector<double> weights;  // of the draws; they sum to 1

  SurfaceDistance expected() const;
  // Probability that the true surface is further away, by its mean or its r.m.s. distance.
  double beyond(const SurfaceDistance& limit) const;
  double shapeBeyond(const SurfaceDistance& limit) const;  // without its distance
};

// Of a change of the parameters, by what is known of it besides; 0: impossible.
using Likelihood = std::function<double(const LowOrderMap::Parameters&)>;

// Draws the parameters from their covariance, always the same ones, and measures how far points of
// the surfaces that they make are from the surface at x: a thin body that is off along its normal
// is still near its other side.
// @param covariance  of the parameters of `here`, which is the identity at x (camera frame)
// @param unseen      deviation along the sight line of what the parameters cannot follow, model
//                    sizes
ShapeUncertainty shapeUncertainty(const Points& x, const Triangles& triangles,
                                  const LowOrderMap& here, const Eigen::MatrixXd& covariance,
                                  double model_size, double unseen, const Likelihood& likelihood);

}  // namespace calipso::align
