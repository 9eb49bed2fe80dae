#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Up to kMost points of one object's surface, laid out for loops of eight lanes, which may read and
// write seven places more.
struct SurfaceRun {
  static constexpr int kMost = 64, kRoom = kMost + 12;

  alignas(32) float column[kRoom];               // of the picture
  alignas(32) float nearness[kRoom];             // of stretches: 1 / depth, 1/m
  alignas(32) float sight[3][kRoom];             // along the way from the eye to it, world
  alignas(32) float normal[3][kRoom];            // unit, faces the viewer
  alignas(32) float sky[kRoom];                  // skyMirrored()
  alignas(32) float ambient[3][kRoom];           // ambientOn(); B, G, R
  alignas(32) float sun[kRoom];                  // visible part of it
  alignas(32) float key_u[kRoom], key_v[kRoom];  // place in Appearance::albedo
  alignas(32) float colour[3][kRoom];            // reflectance, then linear radiance; B, G, R

  // Takes a place's reflectance from a texel; its fourth value is how far it is to stay instead.
  void mix(int place, const cv::Vec4f& texel, bool may_stay) {
    const float stays = may_stay ? texel[3] : 0.0f;
    for (int c = 0; c < 3; ++c) {
      float& x = colour[c][place];
      x = may_stay ? texel[c] + stays * (x - texel[c]) : texel[c];
    }
  }
};

// Sight lines of a row's pixels, by their columns: start + column * rise, of depth 1.
struct SightLines {
  float start[3], rise[3];
};

// Pixels of row v that see one object, at places [offset, offset + count) of a run.
struct PixelStretch {
  int v, count, offset;
  cv::Point corner;  // of Appearance::albedo in the key picture
};

// The light on an object, and what its look makes of it: specularShading() and
// Appearance::radiance() for loops over many points.
struct SurfaceShade {
  float direction[3], sun[3];
  float ambient[9][3], least[3];
  int terms;  // of the harmonics: 1, 4 or 9
  float specular, roughness;
  float floor[3], tint[3];
  float around;  // strength of the mirrored surroundings
};

}  // namespace calipso::render
