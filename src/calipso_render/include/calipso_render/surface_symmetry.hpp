#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calipso_render/rasterizer.hpp"

namespace calipso::render {

// A plane across which a surface is its own mirror image: x is mirrored to x - 2 n (n.x - d).
struct MirrorPlane {
  Eigen::Vector3f normal;
  float offset = 0.0f;

  Eigen::Vector3f point(const Eigen::Vector3f& x) const {
    return x - 2.0f * (normal.dot(x) - offset) * normal;
  }
  Eigen::Vector3f vector(const Eigen::Vector3f& n) const {
    return n - 2.0f * normal.dot(n) * normal;
  }
};

// Planes through the surface's middle, along its principal axes, that map it onto itself to within
// a few per cent of its size.
std::vector<MirrorPlane> mirrorPlanes(const Points& vertices, const Triangles& triangles);

struct Axis {
  Eigen::Vector3f point, direction;  // direction of unit length
};

// The axis of revolution that most of a surface has, whatever else (a handle, a spout) is attached
// to it: the line that the normals of the surface meet, as the normals of a surface of revolution
// do (Pottmann & Randrup 1998). Nothing when less than half of the surface, by area, agrees.
std::optional<Axis> revolutionAxis(const Points& vertices, const Triangles& triangles);

}  // namespace calipso::render
