#pragma once

#include <functional>

#include "calipso_align/low_order_map.hpp"
#include "calipso_align/observation.hpp"

namespace calipso::align {

// Standard deviations of what a user's rough placement and a stock model leave open. Zero: held.
struct LowOrderPrior {
  double rotation_rad = 0.0;
  double in_plane = 0.0;       // translation across the sight line, in model sizes
  double depth = 0.0;          // translation along the sight line, in model sizes
  double log_scale = 0.0;
  double strain = 0.0;         // in the image plane
  double shear = 0.0;          // between the image plane and the sight line
  double strain_depth = 0.0;   // along the sight line
  double quadratic = 0.0;
  double quadratic_depth = 0.0;
};

// Diagonal of the prior's information; infinite where a parameter is held.
LowOrderMap::Parameters information(const LowOrderPrior& prior, const LowOrderMap& map);

struct LowOrderStageOptions {
  LowOrderPrior prior;
  int iterations = 15;
  double smallest_step = 2e-4;  // of the model's size: below, the stage has converged
};

struct LowOrderReport {
  int iterations = 0;
  bool converged = false;
};

// Measurements of the model whose vertices are `x` (camera frame), in iteration k. Weights are
// information: 1 / variance.
using Observe = std::function<Rows(const Points& x, int iteration)>;

// Gauss-Newton over the map's parameters: measurements against the prior around `map` = identity.
LowOrderReport fitLowOrder(const Points& X, const Observe& observe,
                           const LowOrderStageOptions& options, LowOrderMap& map);

// Inverse of measurements plus prior at `map`, for the parameters that are not held (others: zero).
Eigen::MatrixXd covariance(const Points& X, const Rows& rows, const LowOrderPrior& prior,
                           const LowOrderMap& map);

}  // namespace calipso::align
