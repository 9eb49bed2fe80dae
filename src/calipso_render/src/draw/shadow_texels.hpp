#pragma once

#include "calipso_render/visibility.hpp"

namespace calipso::render {

// Samples of a disc for a shadow map's filter. The number of taps is a multiple of 8.
struct ShadowTaps {
  static constexpr int kMost = 32;
  int count = 0;
  alignas(32) float x[kMost], y[kMost];  // unit disc
};

// A shadow map as its filter reads it. What lies in the corner blocks nothing.
struct ShadowTexels {
  const float* heights;  // towards the light, m
  int width, height, stride;
  float spread;  // texels of penumbra per m above the receiver
  // Along the map's columns, its rows and towards the light, world; what the map's corner and its
  // lowest point have of them.
  float axes[3][3], origin[3];
  float texel, highest;  // m
};

}  // namespace calipso::render
