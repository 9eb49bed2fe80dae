#pragma once

#include <vector>

#include "calipso_render/rasterizer.hpp"

namespace calipso::render {

// The first vertex at the place of each; places closer than a few millionths of the mesh's extent
// are one.
std::vector<int> weld(const Points& vertices);

// How the triangles of a mesh that encloses space wind, seen from outside: 1 counterclockwise, -1
// clockwise. 0: the mesh is open somewhere, or its parts do not agree, so that either side of a
// triangle can be seen.
int outsideWinding(const Points& vertices, const Triangles& triangles);

}  // namespace calipso::render
