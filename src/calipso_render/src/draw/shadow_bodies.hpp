#pragma once

// Bodies of the kernels that look shadows up in a map: see kernels.hpp.

#include <algorithm>

#include "draw/eight_lanes.hpp"
#include "draw/shadow_texels.hpp"

namespace calipso::render {

constexpr float kUp = 16384.0f;  // makes the truncation to int a floor
constexpr int kDown = 16384;

// Places beyond all ints, and lanes that nobody asks for, wrap around.
typedef std::uint32_t EightNaturals __attribute__((vector_size(32), aligned(4), may_alias));

CALIPSO_INLINE EightInts lowered(const Eight& x) {
  const EightInts up = __builtin_convertvector(x, EightInts);
  return (EightInts)((EightNaturals)up - kDown);
}

CALIPSO_INLINE Eight gather(const float* from, const EightInts& at) {
  return Eight{from[at[0]], from[at[1]], from[at[2]], from[at[3]],
               from[at[4]], from[at[5]], from[at[6]], from[at[7]]};
}

// from[at] and from[at + 1].
CALIPSO_INLINE void gatherPairs(const float* from, const EightInts& at, Eight& first,
                                Eight& second) {
  typedef double Pairs __attribute__((vector_size(32)));
  const auto pair = [&](int k) {
    double both;
    std::memcpy(&both, from + at[k], sizeof(both));
    return both;
  };
  const Eight a = (Eight)Pairs{pair(0), pair(1), pair(4), pair(5)},
              b = (Eight)Pairs{pair(2), pair(3), pair(6), pair(7)};
  first = __builtin_shuffle(a, b, LaneChoice{0, 2, 8, 10, 4, 6, 12, 14});
  second = __builtin_shuffle(a, b, LaneChoice{1, 3, 9, 11, 5, 7, 13, 15});
}

// Where the texels (i, j) are in the map; the corner for those outside [0, right) x [0, bottom).
CALIPSO_INLINE EightInts texelsAt(const ShadowTexels& map, const EightInts& i, const EightInts& j,
                                  int right, int bottom) {
  const EightInts at = (EightInts)((EightNaturals)j * map.stride + (EightNaturals)i);
  return at & (i >= 0) & (j >= 0) & (i < right) & (j < bottom);
}

// 1 where four texels around (x, y) are higher than h, between them by their parts.
CALIPSO_INLINE Eight coveredAt(const ShadowTexels& map, const Eight& x, const Eight& y,
                               const Eight& h) {
  const EightInts i = lowered(x + kUp), j = lowered(y + kUp);
  const Eight fx = x - __builtin_convertvector(i, Eight),
              fy = y - __builtin_convertvector(j, Eight);
  const EightInts at = texelsAt(map, i, j, map.width - 1, map.height - 1);
  const Eight one = all(1.0f), none{};
  Eight a, b, c, e;
  gatherPairs(map.heights, at, a, b), gatherPairs(map.heights + map.stride, at, c, e);
  a = a > h ? one : none, b = b > h ? one : none, c = c > h ? one : none, e = e > h ? one : none;
  return (a + (b - a) * fx) * (1.0f - fy) + (c + (e - c) * fx) * fy;
}

struct ShadowPlaces {
  Eight s, t, h, search;  // texels, texels, m, texels
};

// Points lifted off their surface so that they do not shade themselves: ShadowMap::placeOf().
CALIPSO_INLINE ShadowPlaces placesOf(const ShadowTexels& map, const LightPoints& points, int k) {
  Eight p[3], along{};
  for (int c = 0; c < 3; ++c) along += eightAt(points.normal[c] + k) * map.axes[2][c];
  const Eight slope = 1.0f - smaller(larger(along, Eight{}), all(1.0f)),
              lift = map.texel * (1.0f + 2.0f * slope);
  for (int c = 0; c < 3; ++c)
    p[c] = eightAt(points.position[c] + k) + eightAt(points.normal[c] + k) * lift;
  Eight q[3];
  for (int i = 0; i < 3; ++i)
    q[i] = p[0] * map.axes[i][0] + p[1] * map.axes[i][1] + p[2] * map.axes[i][2] - map.origin[i];
  const float per_texel = 1.0f / map.texel;
  const Eight h = q[2] + 1.5f * map.texel;
  return {q[0] * per_texel, q[1] * per_texel, h, larger(all(1.5f), map.spread * (map.highest - h))};
}

// Can something within `search` of the places be in the map, and higher?
CALIPSO_INLINE bool mayBeShaded(const ShadowTexels& map, const ShadowPlaces& p) {
  const Eight right = p.search + static_cast<float>(map.width),
              bottom = p.search + static_cast<float>(map.height);
  const EightInts near = (p.h <= map.highest) & (p.s >= -p.search) & (p.t >= -p.search) &
                         (p.s <= right) & (p.t <= bottom);
  return any(near);
}

// The least penumbra, a texel wide: four places tell as much as a disc of them.
CALIPSO_INLINE Eight sharplyCovered(const ShadowTexels& map, const Eight& s, const Eight& t,
                                    const Eight& h) {
  constexpr float kReach = 0.5f;
  return (coveredAt(map, s - kReach, t - kReach, h) + coveredAt(map, s + kReach, t - kReach, h)) +
         (coveredAt(map, s - kReach, t + kReach, h) + coveredAt(map, s + kReach, t + kReach, h));
}

CALIPSO_INLINE Eight visibleEight(const ShadowTexels& map, const ShadowTaps& taps,
                                  const ShadowPlaces& place) {
  const Eight one = all(1.0f), none{};
  if (!mayBeShaded(map, place)) return one;
  const auto [s, t, h, search] = place;
  Eight above{}, hits{};
  for (int k = 0; k < taps.count; ++k) {
    const Eight x = s + search * taps.x[k] + (kUp + 0.5f),
                y = t + search * taps.y[k] + (kUp + 0.5f);
    const EightInts i = lowered(x), j = lowered(y);
    const Eight over = gather(map.heights, texelsAt(map, i, j, map.width, map.height)) - h;
    const EightInts blocks = over > 0.0f;
    above += blocks ? over : none, hits += blocks ? one : none;
  }
  if (!any(hits > 0.0f)) return one;
  const Eight radius = map.spread * above / larger(hits, one);
  const EightInts wide = radius > 1.0f;
  Eight sharp{}, covered{};
  if (any((hits > 0.0f) & ~wide)) sharp = 1.0f - 0.25f * sharplyCovered(map, s, t, h);
  if (any(wide)) {
    for (int k = 0; k < taps.count; ++k)
      covered += coveredAt(map, s + radius * taps.x[k], t + radius * taps.y[k], h);
  }
  const Eight soft = 1.0f - covered / static_cast<float>(taps.count);
  return hits > 0.0f ? (wide ? soft : sharp) : one;
}

CALIPSO_INLINE void visibleBody(const ShadowTexels& map, const ShadowTaps& taps,
                                const LightPoints& points, int count, float* visible) {
  for (int k = 0; k < count; k += 8)
    eightAt(visible + k) = visibleEight(map, taps, placesOf(map, points, k));
}

}  // namespace calipso::render
