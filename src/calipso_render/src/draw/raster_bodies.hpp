#pragma once

// Bodies of the kernels that draw triangles: see kernels.hpp.

#include <cmath>

#include "calipso_render/edge_coverage.hpp"
#include "draw/eight_lanes.hpp"
#include "draw/triangle_span.hpp"

namespace calipso::render {

// Columns inside the triangle, `dv` rows below its first. @return false if there are none
CALIPSO_INLINE bool rowLimits(const TriangleSpan& s, const Four& per_edge_u, float dv, int& from,
                              int& to) {
  const Four bound = -(fourAt(s.edge_0) + fourAt(s.edge_v) * dv) * per_edge_u;
  float low = 0.0f, high = static_cast<float>(s.column_max - s.column_min);
  for (int i = 0; i < 3; ++i) {
    if (per_edge_u[i] < 0.0f)
      high = bound[i] < high ? bound[i] : high;
    else  // a level edge bounds nothing or all
      low = bound[i] > low ? bound[i] : low;
  }
  if (!(low <= high)) return false;  // far off, they might not fit an int
  from = static_cast<int>(low), to = s.column_min + static_cast<int>(high);
  from += s.column_min + (static_cast<float>(from) < low);
  return from <= to;
}

template <bool kIds>
CALIPSO_INLINE void setWhereCloser(const Eight& z, const EightInts& inside, std::uint32_t id,
                                   const SpanTarget& target, std::size_t at) {
  Eight& nearest = *reinterpret_cast<Eight*>(target.nearness + at);
  const EightInts closer = (z > nearest) & inside;
  nearest = closer ? z : nearest;
  if constexpr (!kIds) return;
  EightInts& ids = *reinterpret_cast<EightInts*>(target.ids + at);
  ids = closer ? EightInts{} + static_cast<std::int32_t>(id) : ids;
}

// A triangle of at most eight columns.
template <bool kIds>
CALIPSO_INLINE void fillNarrow(const TriangleSpan& s, int first, int last,
                               const SpanTarget& target) {
  const Eight du = lanes(), slope = s.near_u * (static_cast<float>(s.column_min) + du);
  const EightInts within = du <= static_cast<float>(s.column_max - s.column_min);
  Eight edge[3];
  for (int i = 0; i < 3; ++i) edge[i] = s.edge_0[i] + s.edge_u[i] * du;
  edge[0] = within ? edge[0] : all(-3.0e38f);
  for (int row = first; row <= last; ++row) {
    const Four least = fourAt(s.edge_v) * static_cast<float>(s.row_min - row);
    const EightInts inside = (edge[0] >= least[0]) & (edge[1] >= least[1]) & (edge[2] >= least[2]);
    setWhereCloser<kIds>(s.near_0 + s.near_v * static_cast<float>(row) + slope, inside, s.id,
                         target, static_cast<std::size_t>(row) * target.stride + s.column_min);
  }
}

template <bool kIds>
CALIPSO_INLINE void fillWide(const TriangleSpan& s, int first, int last, const SpanTarget& target) {
  const EightInts numbers = {0, 1, 2, 3, 4, 5, 6, 7};
  const Four per_edge_u = 1.0f / fourAt(s.edge_u);
  for (int row = first; row <= last; ++row) {
    int from, to;
    if (!rowLimits(s, per_edge_u, static_cast<float>(row - s.row_min), from, to)) continue;
    const float base = s.near_0 + s.near_v * static_cast<float>(row);
    for (int u = from; u <= to; u += 8) {
      const EightInts columns = u + numbers;
      const Eight z = base + s.near_u * __builtin_convertvector(columns, Eight);
      setWhereCloser<kIds>(z, columns <= to, s.id, target,
                           static_cast<std::size_t>(row) * target.stride + u);
    }
  }
}

template <bool kIds>
CALIPSO_INLINE void fillSpansBody(const TriangleSpan* spans, const int* which, int count,
                                  const SpanTarget& target) {
  for (int k = 0; k < count; ++k) {
    const TriangleSpan& s = spans[which[k]];
    const int first = s.row_min > target.first ? s.row_min : target.first,
              last = s.row_max < target.last ? s.row_max : target.last;
    if (s.column_max - s.column_min < 8)
      fillNarrow<kIds>(s, first, last, target);
    else
      fillWide<kIds>(s, first, last, target);
  }
}

// What a triangle's linear functions add at a pixel's 4 x 4 samples to what they are at its centre,
// along the row and across it; the upper eight samples, then the lower.
struct SampleSteps {
  Eight edge_u[3], edge_v[2][3], near_u, near_v[2];
};

CALIPSO_INLINE SampleSteps sampleSteps(const TriangleSamples& t) {
  const Eight x = {-0.375f, -0.125f, 0.125f, 0.375f, -0.375f, -0.125f, 0.125f, 0.375f},
              upper = {-0.375f, -0.375f, -0.375f, -0.375f, -0.125f, -0.125f, -0.125f, -0.125f};
  SampleSteps steps;
  steps.near_u = t.near_u * x;
  for (int i = 0; i < 3; ++i) steps.edge_u[i] = t.edge_u[i] * x;
  for (int half = 0; half < 2; ++half) {
    const Eight y = upper + 0.5f * static_cast<float>(half);
    steps.near_v[half] = t.near_v * y;
    for (int i = 0; i < 3; ++i) steps.edge_v[half][i] = t.edge_v[i] * y;
  }
  return steps;
}

// An edge function, at a pixel's centre.
CALIPSO_INLINE float edgeAt(const TriangleSamples& t, int edge, float u, float v) {
  return t.edge_u[edge] * u + t.edge_v[edge] * v + t.edge_0[edge];
}

// The wanted pixels of which a sample may lie in the triangle.
CALIPSO_INLINE std::uint64_t reachedPixels(const TriangleSamples& t, const SampledTile& tile) {
  constexpr float kReach = 0.375f;  // px from the centre to the outermost samples
  float least[3];
  for (int i = 0; i < 3; ++i)
    least[i] = -kReach * (std::fabs(t.edge_u[i]) + std::fabs(t.edge_v[i]));
  std::uint64_t reached = 0;
  for (std::uint64_t rest = tile.wanted; rest != 0; rest &= rest - 1) {
    const int k = __builtin_ctzll(rest);
    const float u = static_cast<float>(tile.u + k % SampledTile::kSide),
                v = static_cast<float>(tile.v + k / SampledTile::kSide);
    const bool reaches = (edgeAt(t, 0, u, v) >= least[0]) & (edgeAt(t, 1, u, v) >= least[1]) &
                         (edgeAt(t, 2, u, v) >= least[2]);
    reached |= static_cast<std::uint64_t>(reaches) << k;
  }
  return reached;
}

CALIPSO_INLINE void drawSamplesAt(const TriangleSamples& t, const SampleSteps& steps, float u,
                                  float v, std::uint32_t id, EdgeCoverage::Pixel& pixel) {
  const float centre[3] = {edgeAt(t, 0, u, v), edgeAt(t, 1, u, v), edgeAt(t, 2, u, v)};
  const float near_centre = t.near_u * u + t.near_v * v + t.near_0;
  for (int half = 0; half < 2; ++half) {
    Eight& nearest = *reinterpret_cast<Eight*>(&pixel.nearness[8 * half]);
    EightInts& ids = *reinterpret_cast<EightInts*>(&pixel.ids[8 * half]);
    const Eight near = near_centre + steps.near_u + steps.near_v[half];
    EightInts wins = near > nearest;
    for (int i = 0; i < 3; ++i) wins &= centre[i] + steps.edge_u[i] + steps.edge_v[half][i] >= 0.0f;
    nearest = wins ? near : nearest;
    ids = wins ? EightInts{} + static_cast<std::int32_t>(id) : ids;
  }
}

CALIPSO_INLINE void drawSamplesBody(const TriangleSamples& t, const SampledTile& tile,
                                    std::uint32_t id, EdgeCoverage::Pixel* pixels) {
  const std::uint64_t reached = reachedPixels(t, tile);
  if (reached == 0) return;
  const SampleSteps steps = sampleSteps(t);
  for (std::uint64_t rest = reached; rest != 0; rest &= rest - 1) {
    const int k = __builtin_ctzll(rest);
    drawSamplesAt(t, steps, static_cast<float>(tile.u + k % SampledTile::kSide),
                  static_cast<float>(tile.v + k / SampledTile::kSide), id, pixels[tile.pixels[k]]);
  }
}

}  // namespace calipso::render
