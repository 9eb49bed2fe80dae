#pragma once

#include <vector>

#include "calipso_render/light.hpp"
#include "calipso_render/visibility.hpp"

namespace calipso::render {

// What every vertex of a mesh sees of the sky past the mesh itself, and what that throws back.
// @param normals unit, or 0 where a vertex has no face
// @param open the mesh has two sides that can be seen
// @param behind out: of the side that the normals turn away from; empty unless `open`
void findSkySeen(const Points& vertices, const Points& normals, const Triangles& triangles,
                 bool open, std::vector<SkySeen>& seen, std::vector<SkySeen>& behind);

}  // namespace calipso::render
