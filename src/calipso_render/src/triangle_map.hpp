#pragma once

#include <cstdint>
#include <vector>

#include "calipso_render/appearance.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// What the pixels of a drawn triangle show, linear in the picture: the place in the key frame's
// picture, homogeneous, and the barycentric weights up to a common factor. Counted from the
// triangle's first corner, where single precision is exact.
struct alignas(16) TriangleMap {
  float key[3][4];           // at the corner, per column, per row; x, y, w, 0
  float weights[3][4];       // likewise; of the three corners, 0
  float u = 0.0f, v = 0.0f;  // the corner, px
  bool thin = true;          // too thin for single precision, or never seen

  Eigen::Vector2f keyAt(float pixel_u, float pixel_v) const;
  Eigen::Vector3f weightsAt(float pixel_u, float pixel_v) const;  // clamped into the triangle
};

// One for each triangle of the actor.
std::vector<TriangleMap> triangleMaps(const Actor& actor, const Appearance& appearance);

}  // namespace calipso::render
