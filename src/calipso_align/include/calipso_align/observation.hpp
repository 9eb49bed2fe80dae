#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace calipso::align {

// One linearised measurement of the model: residual r, and its derivative g with respect to a point
// in the camera frame whose barycentric weights on a face are a; on an edge or a vertex some are 0.
//   energy = 1/2 sum of weight r^2 ;  dr = g . sum of a_k dx_vk
struct PointRow {
  std::array<int, 3> v;
  std::array<double, 3> a;
  Eigen::Vector3d g;  // unit of r per m
  double r;
  double weight;  // 1 / (unit of r)^2
};

// Of vertex i.
inline PointRow vertexRow(int i, const Eigen::Vector3d& g, double r, double weight) {
  return {{i, i, i}, {1.0, 0.0, 0.0}, g, r, weight};
}

using Rows = std::vector<PointRow>;

// Geman-McClure: weight of a residual r whose outliers lie beyond c.
inline double gemanMcClure(double r, double c) {
  const double q = c * c / (c * c + r * r);
  return q * q;
}

}  // namespace calipso::align
