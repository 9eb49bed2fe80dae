#include "calipso_scene/half_edges.hpp"

#include <algorithm>
#include <tuple>

namespace calipso {

std::vector<HalfEdge> sortedHalfEdges(
    const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles) {
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(3 * triangles.rows());
  for (int f = 0; f < triangles.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int a = triangles(f, k), b = triangles(f, (k + 1) % 3);
      half_edges.push_back({std::min(a, b), std::max(a, b), f, a < b});
    }
  }
  std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.face, a.forward) < std::tie(b.low, b.high, b.face, b.forward);
  });
  return half_edges;
}

}  // namespace calipso
