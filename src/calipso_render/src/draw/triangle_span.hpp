#pragma once

#include <cstdint>

namespace calipso::render {

// A triangle made ready to be filled, in the buffer's coordinates: its limits; edge functions, per
// column, per row and at the corner of the limits (inside: none of the three is negative); nearness
// is a plane.
struct TriangleSpan {
  float edge_u[4], edge_v[4], edge_0[4];
  float near_u, near_v, near_0;
  int row_min, row_max, column_min, column_max;
  std::uint32_t id;
};

// Rows [first, last] of a buffer that triangles are drawn into; nearer wins, at a tie what was
// drawn first.
struct SpanTarget {
  std::uint32_t* ids;  // null: only nearness is kept
  float* nearness;
  int stride;  // places per row: the width, and at least 7 more
  int first, last;
};

// A triangle at all samples of a pixel at once: edge functions (inside: none is negative) and
// nearness, linear in the picture.
struct TriangleSamples {
  float edge_u[3], edge_v[3], edge_0[3];
  float near_u, near_v, near_0;
};

// The pixels of a square that have samples and that a triangle may touch.
struct SampledTile {
  static constexpr int kSide = 8;  // px

  int u, v;              // the first pixel's place
  std::uint64_t wanted;  // a bit for each pixel, row by row
  const int* pixels;     // per pixel of the square: which samples
};

}  // namespace calipso::render
