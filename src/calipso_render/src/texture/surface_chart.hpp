#pragma once

#include <array>
#include <vector>

#include "calipso_render/rasterizer.hpp"

namespace calipso::render {

// A triangle in the plane.
struct FlatTriangle {
  int triangle = -1;
  std::array<Eigen::Vector2f, 3> corners;
};

// Lays parts of a surface flat: from a triangle outwards, each is hinged into the plane at the edge
// by which it is reached, as long as that stretches none by much and none comes to lie on another
// (a discrete exponential map). A developable surface keeps its lengths.
class SurfaceUnfolder {
 public:
  SurfaceUnfolder(const Points& vertices, const Triangles& triangles);

  // @param seed triangle whose middle is the origin; without area: nothing is laid
  // @param down direction on the surface that becomes +y, as far as it is one there
  // @param radius how far from the origin the middles of triangles may come to lie, m
  // @return in the plane, m; x and y so that the triangles wind counterclockwise
  std::vector<FlatTriangle> around(int seed, const Eigen::Vector3f& down, float radius) const;

  // Triangles across the edges of a triangle; -1: none, or more than one.
  const std::array<int, 3>& neighbours(int triangle) const { return neighbours_[triangle]; }
  Eigen::Vector3f middle(int triangle) const;

  // Way along the surface to the nearest triangle with goal[triangle], from middle to middle, m;
  // infinite where there is none.
  std::vector<float> distances(const std::vector<bool>& goal) const;

 private:
  const Points& vertices_;
  const Triangles& triangles_;
  std::vector<int> place_;  // per vertex: the first at its place
  std::vector<std::array<int, 3>> neighbours_;
};

}  // namespace calipso::render
