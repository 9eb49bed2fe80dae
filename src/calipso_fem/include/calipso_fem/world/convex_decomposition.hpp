#pragma once

#include <vector>

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

struct DecompositionParams {
  double concavity = 0.02;  // stop when the hulls exceed the solid by this share of its volume
  int max_hulls = 24;
  // candidate planes per axis and split; if that does not do, half as many more, twice
  int cuts_per_axis = 7;
  int grid = 48;  // cells along the longest side, for volumes and inside tests
};

// Approximate convex decomposition: the bounding box is split by axis-aligned planes, always the
// part whose hull exceeds the solid most and where the two new hulls have the least volume; every
// part is the hull of the surface clipped to its box (plus box corners inside the solid). Parts
// touch, and together cover the solid. Deterministic.
// @return hulls in the mesh's frame, at least one
// @throw std::invalid_argument if the mesh is empty or flat
std::vector<TriangleMesh> decomposeConvex(const TriangleMesh& mesh,
                                          const DecompositionParams& params = {});

}  // namespace calipso::fem
