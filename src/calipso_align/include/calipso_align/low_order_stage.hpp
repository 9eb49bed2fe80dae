#pragma once

#include <functional>

#include "calipso_align/low_order_map.hpp"
#include "calipso_align/observation.hpp"

namespace calipso::align {

// What a user's rough placement and a stock model leave open, as standard deviations. Zero: held.
//
// The deformation is a random field whose correlation length L is the object's size, the same in
// all directions: the picture decides across the sight line, along it stays what the prior expects.
// With y = d / l (LowOrderMap) its Taylor coefficients deviate by
//   a                      linear, each entry of a 3 x 3 matrix
//   a l/L {sqrt(3)/2, 1}   quadratic, squares and products of two coordinates
// The rough placement is one of the whole deformed object: what it is off by is the rigid part of
// the map (rigid_part.hpp), whichever of the parameters that comes from.
struct LowOrderPrior {
  double rotation_rad = 0.0;
  double in_plane = 0.0;  // translation across the sight line, in model sizes
  double depth = 0.0;     // translation along the sight line, in model sizes
  double log_scale = 0.0;
  double deformation = 0.0;  // a
  bool quadratic = false;    // whether the quadratic coefficients are free
};

constexpr double kOrderRatio = 0.4;  // l / L: a body's size is two to three times its r.m.s. radius

// Diagonal of the prior's information; infinite where a parameter is held.
LowOrderMap::Parameters information(const LowOrderPrior& prior);

struct LowOrderStageOptions {
  LowOrderPrior prior;
  int iterations = 15;
  double smallest_step = 2e-4;  // of the model's size: below, the stage has converged
  // Re-estimates a from the coefficients that the measurements determine, of which there are
  // gamma = sum of 1 - C_ii / (a s_i)^2 (MacKay 1992). As they are few, the mean of a^2 and not its
  // mode:
  //   a^2 = sum (p_i / s_i)^2 / (gamma - 2)      (log a unknown: inverse gamma distribution)
  bool estimate_deformation = false;
};

struct LowOrderReport {
  int iterations = 0;
  bool converged = false;
  double deformation = 0.0;  // a, as given or estimated
};

// Measurements of the model whose vertices are `x` (camera frame), in iteration k, when
// deformations are as large as `a`. Weights are information: 1 / variance.
using Observe = std::function<Rows(const Points& x, int iteration, double a)>;

// Gauss-Newton over the map's parameters: measurements against the prior around `map` = identity.
LowOrderReport fitLowOrder(const Points& X, const Observe& observe,
                           const LowOrderStageOptions& options, LowOrderMap& map);

// Inverse of measurements plus prior at `map`, for the parameters that are not held (others: zero).
Eigen::MatrixXd covariance(const Points& X, const Rows& rows, const LowOrderPrior& prior,
                           const LowOrderMap& map);

}  // namespace calipso::align
