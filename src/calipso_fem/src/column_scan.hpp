#pragma once

#include <Eigen/Core>
#include <vector>

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

// A regular set of sight lines parallel to one axis. Line (i, j) passes through
// (u, v) = origin + (spacing (i + 1/2), spacing (j + 1/2)) in the plane of the two other axes.
struct ColumnLayout {
  int axis = 2;  // direction of the lines; u, v: the next two, cyclic
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double spacing = 1.0;  // m
  int u_count = 0, v_count = 0;

  int u() const { return (axis + 1) % 3; }
  int v() const { return (axis + 2) % 3; }
};

struct Crossing {
  double depth;  // coordinate along the axis, m
  int sign;      // +1 into the solid, -1 out of it
};

// The crossings of every line with the surface, ascending, at index i + u_count * j. Lines that hit
// an edge meet exactly one of its two triangles. sign is multiplied by `orientation` (-1 for a
// surface whose faces point inwards).
std::vector<std::vector<Crossing>> scanColumns(const TriangleMesh& surface,
                                               const ColumnLayout& layout, int orientation);

// True when every line leaves the solid as often as it enters it.
bool isBalanced(const std::vector<Crossing>& crossings);

// Calls inside(from, to) for every interval of the line within the solid. @pre isBalanced
template <class Inside>
void forEachInterval(const std::vector<Crossing>& crossings, const Inside& inside) {
  int winding = 0;
  double from = 0.0;
  for (const Crossing& c : crossings) {
    const int next = winding + c.sign;
    if (winding <= 0 && next > 0) from = c.depth;
    if (winding > 0 && next <= 0) inside(from, c.depth);
    winding = next;
  }
}

}  // namespace calipso::fem
