#pragma once

#include <vector>

#include "calipso_render/surface_texture.hpp"

namespace calipso::render {

// Continues a surface's pattern over what no picture shows of it: the surface is laid flat around
// every unknown part, which is then filled with copies of what is known around it and of the best
// seen part, so that every patch resembles one of them. A surface without a pattern is left as it
// is, and so is what does not hang together with that part.
// @param certain per texel, in [0, 1]: how far it is known; out: 1 where the texel has been filled
// @param down direction (of vertices) that stays down in what is copied: patterns seldom turn
void continuePattern(const Points& vertices, const Triangles& triangles,
                     const Eigen::Vector3f& down, std::vector<float>& certain,
                     SurfaceTexture& texture);

}  // namespace calipso::render
