#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/surface_texture.hpp"

namespace calipso::render {

// texels of a part that are certain, at least: fewer are not like the whole of it
constexpr std::size_t kFewestKnown = 20;

// Per shell of which fewer are certain: mean colour of what is seen of it at all, be it at rims alone
// (a rope).
using FaintColours = std::vector<std::optional<cv::Vec3f>>;

// What no picture shows, or none for certain, continues the surface around it, and goes over to
// what its part of the mesh is like on the whole: the rim of what is seen is seen flatly, with the
// sky and the background in it.
// @param pieces, shells smoothParts() and connectedParts() of the surface
// @param certain per texel: 1 = it is known, 0 = nothing of it
void fillUnseen(const Surface& surface, const std::vector<int>& pieces,
                const std::vector<int>& shells, const FaintColours& faint,
                const std::vector<float>& certain, SurfaceTexture& texture);

}  // namespace calipso::render
