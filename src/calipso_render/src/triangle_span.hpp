#pragma once

#include <cstdint>

namespace calipso::render {

// A triangle made ready for row spans, in the buffer's coordinates. Row v lies inside from the
// greater of the first two bounds to the lesser of the last two, each linear in v, within the
// columns' limits; nearness is a plane.
struct TriangleSpan {
  float column[4], row[4], slope[4];  // a point of each bound, and columns per row
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

// The part of a square of pixels that a triangle may touch, and which of its pixels have samples.
struct SampledTile {
  static constexpr int kSide = 8;  // px

  int u, v;                    // the first pixel's place
  int first, last;             // rows of the square
  unsigned columns;            // a bit for each
  const std::uint8_t* chosen;  // per row: a bit for each pixel that has samples
  const int* pixels;           // per pixel of the square: which samples
};

}  // namespace calipso::render
