#pragma once

// Bodies of the kernels that tell what drawn pixels show and shade it: see kernels.hpp.

#include <algorithm>

#include "calipso_render/light.hpp"
#include "calipso_render/rasterizer.hpp"
#include "draw/eight_lanes.hpp"
#include "draw/surface_run.hpp"
#include "draw/triangle_map.hpp"

namespace calipso::render {

CALIPSO_INLINE void normalise(Eight (&n)[3]) {
  const Eight squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
  const Eight scale = 1.0f / squareRoot(squared > 0.0f ? squared : all(1.0f));
  for (Eight& x : n) x *= scale;
}

// Where a triangle's far side is seen, its normals are turned round if they look away.
CALIPSO_INLINE void turnToViewer(const SightLines& sight, const Eight& column, Eight (&n)[3]) {
  Eight away{};
  for (int c = 0; c < 3; ++c) away += n[c] * (sight.start[c] + sight.rise[c] * column);
  for (Eight& x : n) x = away > 0.0f ? -x : x;
}

// The triangles' linear functions at a stretch's pixels: nearness, and up to that as a factor key
// places, normals, sky and ambient light.
// @param weights of the key places
// @return the triangles' traits, of any of them
CALIPSO_INLINE unsigned evaluateMaps(const TriangleMap* maps, const std::uint32_t* ids,
                                     const PixelStretch& at, const SightLines& sight,
                                     SurfaceRun& run, float (&weights)[SurfaceRun::kRoom]) {
  unsigned traits = 0;
  for (int k = 0; k < at.count;) {
    const std::uint32_t id = ids[k];
    const TriangleMap& map = maps[VisibilityBuffer::triangleOf(id)];
    traits |= map.traits;
    const float dv = static_cast<float>(at.v) - map.v;
    const Four key = fourAt(map.key[0]) + fourAt(map.key[2]) * dv,
               normal = fourAt(map.normal[0]) + fourAt(map.normal[2]) * dv,
               ambient = fourAt(map.ambient[0]) + fourAt(map.ambient[2]) * dv;
    const float *key_rise = map.key[1], *normal_rise = map.normal[1],
                *ambient_rise = map.ambient[1];
    int seen;  // of eight pixels
    do {
      const int to = at.offset + k;
      const Eight column = eightAt(run.column + to), du = column - map.u;
      eightAt(run.key_u + to) = key[0] + key_rise[0] * du;
      eightAt(run.key_v + to) = key[1] + key_rise[1] * du;
      eightAt(weights + to) = key[2] + key_rise[2] * du;
      eightAt(run.nearness + to) = key[3] + key_rise[3] * du;
      Eight n[3];
      for (int c = 0; c < 3; ++c) n[c] = normal[c] + normal_rise[c] * du;
      if (map.is(TriangleMap::kTurned)) turnToViewer(sight, column, n);
      for (int c = 0; c < 3; ++c) eightAt(run.normal[c] + to) = n[c];
      eightAt(run.sky + to) = normal[3] + normal_rise[3] * du;
      for (int c = 0; c < 3; ++c) eightAt(run.ambient[c] + to) = ambient[c] + ambient_rise[c] * du;
      seen = leadingLanes(*reinterpret_cast<const EightInts*>(ids + k) ==
                          static_cast<std::int32_t>(id));
      k += seen;
    } while (seen == 8 && k < at.count && ids[k] == id);
  }
  return traits;
}

CALIPSO_INLINE unsigned locateBody(const TriangleMap* maps, const std::uint32_t* ids,
                                   const PixelStretch& at, const SightLines& sight,
                                   SurfaceRun& run) {
  const float left = static_cast<float>(at.corner.x), top = static_cast<float>(at.corner.y);
  alignas(32) float weights[SurfaceRun::kRoom];
  const unsigned traits = evaluateMaps(maps, ids, at, sight, run, weights);
  for (int k = at.offset; k < at.offset + at.count; k += 8) {
    const Eight w = eightAt(weights + k), sum = eightAt(run.nearness + k),
                inverse = 1.0f / (w * sum), scale = sum * inverse;
    eightAt(run.key_u + k) = eightAt(run.key_u + k) * scale - left;
    eightAt(run.key_v + k) = eightAt(run.key_v + k) * scale - top;
    const Eight linear = w * inverse;
    eightAt(run.sky + k) = eightAt(run.sky + k) * linear;
    for (int c = 0; c < 3; ++c) eightAt(run.ambient[c] + k) = eightAt(run.ambient[c] + k) * linear;
    for (int c = 0; c < 3; ++c)
      eightAt(run.sight[c] + k) = sight.start[c] + sight.rise[c] * eightAt(run.column + k);
    Eight n[3] = {eightAt(run.normal[0] + k), eightAt(run.normal[1] + k),
                  eightAt(run.normal[2] + k)};
    normalise(n);
    for (int c = 0; c < 3; ++c) eightAt(run.normal[c] + k) = n[c];
  }
  return traits;
}

CALIPSO_INLINE Eight ambientBody(const SurfaceShade& s, int c, const Eight (&n)[3],
                                 const Eight (&second)[5]) {
  Eight sum = all(s.ambient[0][c]);
  if (s.terms > 1) sum += s.ambient[1][c] * n[1] + s.ambient[2][c] * n[2] + s.ambient[3][c] * n[0];
  if (s.terms > 4) {
    for (int i = 0; i < 5; ++i) sum += s.ambient[4 + i][c] * second[i];
  }
  return larger(sum, all(s.least[c]));
}

// Harmonics of the second band: shBasis().
CALIPSO_INLINE void secondBand(const Eight (&n)[3], Eight (&out)[5]) {
  const Eight &x = n[0], &y = n[1], &z = n[2];
  out[0] = x * y, out[1] = y * z, out[2] = 3.0f * z * z - 1.0f, out[3] = x * z,
  out[4] = x * x - y * y;
}

// torranceSparrow() where the light reaches the surface; what it is elsewhere does not matter.
CALIPSO_INLINE Eight lobeBody(const SurfaceShade& s, const Eight (&n)[3], const Eight (&view)[3],
                              const Eight& n_l, const Eight& n_v) {
  Eight squared{}, along{};  // of l + v, which is twice v.h long
  for (int c = 0; c < 3; ++c) {
    const Eight sum = s.direction[c] + view[c];
    squared += sum * sum, along += n[c] * sum;
  }
  const float m2 = s.roughness * s.roughness;
  const Eight c2 = along * along / squared;  // of c = n.h
  const Eight root = 1.0f - c2 * (1.0f - m2), D = m2 / (root * root);
  const Eight G = smaller(all(1.0f), 4.0f * along * smaller(n_v, n_l) / squared);
  return D * G / (4.0f * n_v);
}

// grazing() of what the surroundings send back.
CALIPSO_INLINE Eight grazingBody(float growth, const Eight& n_v) {
  const Eight rest = 1.0f - smaller(larger(n_v, Eight{}), all(1.0f)), squared = rest * rest;
  return 1.0f + growth * (squared * squared * rest);
}

CALIPSO_INLINE void shadeEight(const SurfaceShade& s, float growth, int k, SurfaceRun& run) {
  constexpr float kHorizon = 1e-4f;
  const Eight n[3] = {eightAt(run.normal[0] + k), eightAt(run.normal[1] + k),
                      eightAt(run.normal[2] + k)};
  const Eight sky = eightAt(run.sky + k), sun = eightAt(run.sun + k);
  const Eight n_l =
      larger(n[0] * s.direction[0] + n[1] * s.direction[1] + n[2] * s.direction[2], Eight{});
  Eight out[3];
  const Eight sunlit = n_l * sun;
  for (int c = 0; c < 3; ++c) {
    const Eight diffuse = eightAt(run.ambient[c] + k) + s.sun[c] * sunlit;
    out[c] = eightAt(run.colour[c] + k) * s.tint[c] * (diffuse + s.floor[c]);
  }
  if (s.specular > 0.0f || s.around > 0.0f) {
    Eight view[3], mirrored[3], second[5], n_v{};
    for (int c = 0; c < 3; ++c) view[c] = -eightAt(run.sight[c] + k);
    normalise(view);
    for (int c = 0; c < 3; ++c) n_v += n[c] * view[c];
    for (int c = 0; c < 3; ++c) mirrored[c] = 2.0f * n_v * n[c] - view[c];
    if (s.terms > 4) secondBand(mirrored, second);
    const Eight from_around = s.around * sky * grazingBody(growth, n_v);
    for (int c = 0; c < 3; ++c) out[c] += ambientBody(s, c, mirrored, second) * from_around;
    if (any(sunlit > 0.0f)) {  // places beyond the run may be no numbers
      const EightInts seen = (n_l > kHorizon) & (n_v > kHorizon);
      const Eight from_sun = seen ? s.specular * sun * lobeBody(s, n, view, n_l, n_v) : Eight{};
      for (int c = 0; c < 3; ++c) out[c] += s.sun[c] * from_sun;
    }
  }
  for (int c = 0; c < 3; ++c) eightAt(run.colour[c] + k) = out[c];
}

CALIPSO_INLINE void shadeBody(const SurfaceShade& s, int first, int last, SurfaceRun& run) {
  const float growth = grazingGrowth({s.specular, s.roughness, s.around});
  for (int k = first; k < last; k += 8) shadeEight(s, growth, k, run);
}

}  // namespace calipso::render
