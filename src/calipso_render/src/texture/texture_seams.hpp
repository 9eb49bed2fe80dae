#pragma once

#include <vector>

#include "calipso_render/surface_texture.hpp"

namespace calipso::render {

// Evens out the steps between parts of a texture that were copied from different places: each part
// is made brighter or darker, by what its borders lack, harmonically between them (membrane
// interpolation on the surface, Farbman et al. 2009, of logarithms). Its hues stay: a border that is
// seen flatly has the sky or the background in it, and a shift of colours would carry that over the
// part. A step that is too large for a difference of light is the pattern's and stays.
// @param part per texel: 0 = as seen, which stays; k > 0 = from the k-th source; < 0 = of none
void levelSeams(const Points& vertices, const Triangles& triangles,
                const std::vector<signed char>& part, SurfaceTexture& texture);

}  // namespace calipso::render
