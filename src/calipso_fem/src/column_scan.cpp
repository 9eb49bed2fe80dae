#include "column_scan.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace calipso::fem {
namespace {

using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Which side of the edge a-b the point lies on: +1 left, -1 right, never 0. Endpoints are ordered
// first, so that both triangles of an edge get the same answer to the last bit.
int side(Vector2d a, Vector2d b, const Vector2d& p) {
  const bool swap = std::make_pair(b.x(), b.y()) < std::make_pair(a.x(), a.y());
  if (swap) std::swap(a, b);
  const int s = cross(b - a, p - a) >= 0.0 ? 1 : -1;
  return swap ? -s : s;
}

struct Projected {
  Vector2d p[3];  // u, v
  double depth[3];
};

// Depth of the triangle's plane above (u, v).
double depthAt(const Projected& t, const Vector2d& p) {
  const double area = cross(t.p[1] - t.p[0], t.p[2] - t.p[0]);
  const double b = cross(p - t.p[0], t.p[2] - t.p[0]) / area;
  const double c = cross(t.p[1] - t.p[0], p - t.p[0]) / area;
  const double depth = t.depth[0] + b * (t.depth[1] - t.depth[0]) + c * (t.depth[2] - t.depth[0]);
  const auto [lowest, highest] = std::minmax({t.depth[0], t.depth[1], t.depth[2]});
  return std::clamp(depth, lowest, highest);
}

}  // namespace

std::vector<std::vector<Crossing>> scanColumns(const TriangleMesh& surface,
                                               const ColumnLayout& layout, int orientation) {
  std::vector<std::vector<Crossing>> columns(static_cast<std::size_t>(layout.u_count) *
                                             layout.v_count);
  const Vector2d origin(layout.origin[layout.u()], layout.origin[layout.v()]);
  for (int face = 0; face < surface.triangleCount(); ++face) {
    Projected t;
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d x = surface.vertex(surface.triangles(face, c));
      t.p[c] = (Vector2d(x[layout.u()], x[layout.v()]) - origin) / layout.spacing;
      t.depth[c] = x[layout.axis];
    }
    const double area = cross(t.p[1] - t.p[0], t.p[2] - t.p[0]);
    if (area == 0.0) continue;
    const Vector2d low = t.p[0].cwiseMin(t.p[1]).cwiseMin(t.p[2]);
    const Vector2d high = t.p[0].cwiseMax(t.p[1]).cwiseMax(t.p[2]);
    const int i0 = std::max(0, static_cast<int>(std::ceil(low.x() - 0.5)));
    const int i1 = std::min(layout.u_count - 1, static_cast<int>(std::floor(high.x() - 0.5)));
    const int j0 = std::max(0, static_cast<int>(std::ceil(low.y() - 0.5)));
    const int j1 = std::min(layout.v_count - 1, static_cast<int>(std::floor(high.y() - 0.5)));
    const int turn = area > 0.0 ? 1 : -1;
    for (int j = j0; j <= j1; ++j)
      for (int i = i0; i <= i1; ++i) {
        const Vector2d p(i + 0.5, j + 0.5);
        if (side(t.p[0], t.p[1], p) != turn || side(t.p[1], t.p[2], p) != turn ||
            side(t.p[2], t.p[0], p) != turn)
          continue;
        // A face that turns left in (u, v) has its outward normal along +axis: the line leaves.
        columns[i + static_cast<std::size_t>(layout.u_count) * j].push_back(
            {depthAt(t, p), -turn * orientation});
      }
  }
  for (auto& column : columns)
    std::sort(column.begin(), column.end(), [](const Crossing& a, const Crossing& b) {
      return a.depth != b.depth ? a.depth < b.depth : a.sign > b.sign;
    });
  return columns;
}

bool isBalanced(const std::vector<Crossing>& crossings) {
  int winding = 0;
  for (const Crossing& c : crossings) winding += c.sign;
  return winding == 0;
}

}  // namespace calipso::fem
