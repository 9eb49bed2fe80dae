#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::align {

// One linearised measurement of the model: residual r, and its derivative g with respect to a point
// in the camera frame that lies a0 : a1 between vertices v0 and v1.
//   energy = 1/2 sum of weight r^2 ;  dr = g . (a0 dx_v0 + a1 dx_v1)
struct PointRow {
  int v0, v1;
  double a0, a1;
  Eigen::Vector3d g;  // unit of r per m
  double r;
  double weight;  // 1 / (unit of r)^2
};

using Rows = std::vector<PointRow>;

// Geman-McClure: weight of a residual r whose outliers lie beyond c.
inline double gemanMcClure(double r, double c) {
  const double q = c * c / (c * c + r * r);
  return q * q;
}

}  // namespace calipso::align
