#pragma once

// Bodies of the kernels that draw triangles: see kernels.hpp.

#include <cmath>

#include "calipso_render/edge_coverage.hpp"
#include "eight_lanes.hpp"
#include "triangle_span.hpp"

namespace calipso::render {

// Columns of row v inside the triangle. @return false if there are none
CALIPSO_INLINE bool rowLimits(const TriangleSpan& s, float v, int& from, int& to) {
  const Four bound =
      *reinterpret_cast<const Four*>(s.column) +
      *reinterpret_cast<const Four*>(s.slope) * (v - *reinterpret_cast<const Four*>(s.row));
  float low = static_cast<float>(s.column_min), high = static_cast<float>(s.column_max);
  low = bound[0] > low ? bound[0] : low, high = bound[2] < high ? bound[2] : high;
  low = bound[1] > low ? bound[1] : low, high = bound[3] < high ? bound[3] : high;
  if (!(low <= high)) return false;  // far off, they might not fit an int
  from = static_cast<int>(low), to = static_cast<int>(high);
  from += static_cast<float>(from) < low;
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
  const EightInts lanes = {0, 1, 2, 3, 4, 5, 6, 7}, columns = s.column_min + lanes;
  const Eight u = __builtin_convertvector(columns, Eight), slope = s.near_u * u;
  const EightInts within = columns <= s.column_max;
  for (int row = first; row <= last; ++row) {
    const float v = static_cast<float>(row);
    const Four bound =
        *reinterpret_cast<const Four*>(s.column) +
        *reinterpret_cast<const Four*>(s.slope) * (v - *reinterpret_cast<const Four*>(s.row));
    const EightInts inside =
        within & (u >= bound[0]) & (u >= bound[1]) & (u <= bound[2]) & (u <= bound[3]);
    setWhereCloser<kIds>(s.near_0 + s.near_v * v + slope, inside, s.id, target,
                         static_cast<std::size_t>(row) * target.stride + s.column_min);
  }
}

template <bool kIds>
CALIPSO_INLINE void fillWide(const TriangleSpan& s, int first, int last, const SpanTarget& target) {
  const EightInts lanes = {0, 1, 2, 3, 4, 5, 6, 7};
  for (int row = first; row <= last; ++row) {
    int from, to;
    if (!rowLimits(s, static_cast<float>(row), from, to)) continue;
    const float base = s.near_0 + s.near_v * static_cast<float>(row);
    for (int u = from; u <= to; u += 8) {
      const EightInts columns = u + lanes;
      const Eight z = base + s.near_u * __builtin_convertvector(columns, Eight);
      setWhereCloser<kIds>(z, columns <= to, s.id, target,
                           static_cast<std::size_t>(row) * target.stride + u);
    }
  }
}

template <bool kIds>
CALIPSO_INLINE void fillSpansBody(const TriangleSpan* spans, int count, const SpanTarget& target) {
  for (const TriangleSpan* s = spans; s != spans + count; ++s) {
    const int first = s->row_min > target.first ? s->row_min : target.first,
              last = s->row_max < target.last ? s->row_max : target.last;
    if (first > last) continue;
    if (s->column_max - s->column_min < 8)
      fillNarrow<kIds>(*s, first, last, target);
    else
      fillWide<kIds>(*s, first, last, target);
  }
}

// What a triangle's linear functions add at a pixel's 4 x 4 samples to what they are at its centre,
// along the row and across it; the upper eight samples, then the lower.
struct SampleSteps {
  Eight edge_u[3], edge_v[2][3], near_u, near_v[2];
  float reach[3];  // the most that an edge function can grow by
};

CALIPSO_INLINE SampleSteps sampleSteps(const TriangleSamples& t) {
  constexpr float kReach = 0.375f;  // px from the centre to the outermost samples
  const Eight x = {-0.375f, -0.125f, 0.125f, 0.375f, -0.375f, -0.125f, 0.125f, 0.375f},
              upper = {-0.375f, -0.375f, -0.375f, -0.375f, -0.125f, -0.125f, -0.125f, -0.125f};
  SampleSteps steps;
  steps.near_u = t.near_u * x;
  for (int i = 0; i < 3; ++i) {
    steps.edge_u[i] = t.edge_u[i] * x;
    steps.reach[i] = kReach * (std::fabs(t.edge_u[i]) + std::fabs(t.edge_v[i]));
  }
  for (int half = 0; half < 2; ++half) {
    const Eight y = upper + 0.5f * static_cast<float>(half);
    steps.near_v[half] = t.near_v * y;
    for (int i = 0; i < 3; ++i) steps.edge_v[half][i] = t.edge_v[i] * y;
  }
  return steps;
}

CALIPSO_INLINE void drawSamplesAt(const TriangleSamples& t, const SampleSteps& steps, float u,
                                  float v, std::uint32_t id, EdgeCoverage::Pixel& pixel) {
  float centre[3];
  for (int i = 0; i < 3; ++i) {
    centre[i] = t.edge_u[i] * u + t.edge_v[i] * v + t.edge_0[i];
    if (centre[i] < -steps.reach[i]) return;
  }
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
  const SampleSteps steps = sampleSteps(t);
  for (int row = tile.first; row <= tile.last; ++row) {
    for (unsigned rest = tile.chosen[row] & tile.columns; rest != 0; rest &= rest - 1) {
      const int column = __builtin_ctz(rest);
      drawSamplesAt(t, steps, static_cast<float>(tile.u + column), static_cast<float>(tile.v + row),
                    id, pixels[tile.pixels[row * SampledTile::kSide + column]]);
    }
  }
}

}  // namespace calipso::render
