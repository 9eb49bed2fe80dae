#pragma once

#include <vector>

#include "calipso_render/surface_texture.hpp"

namespace calipso::render {

// What no picture shows, or none for certain, continues the surface around it, and goes over to
// what its part of the mesh is like on the whole: the rim of what is seen is seen flatly, with the
// sky and the background in it.
// @param pieces, shells smoothParts() and connectedParts() of the surface
// @param certain per texel: 1 = it is known, 0 = nothing of it
void fillUnseen(const Surface& surface, const std::vector<int>& pieces,
                const std::vector<int>& shells, const std::vector<float>& certain,
                SurfaceTexture& texture);

}  // namespace calipso::render
