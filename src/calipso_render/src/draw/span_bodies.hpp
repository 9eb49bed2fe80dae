#pragma once

// Body of the kernel that makes triangles ready to be filled, eight at a time: see kernels.hpp.

#include "calipso_render/rasterizer.hpp"
#include "draw/eight_lanes.hpp"
#include "draw/triangle_span.hpp"

namespace calipso::render {

// px; shared edges belong to both sides, so no cracks
constexpr float kEdgeTolerance = 1e-3f;
constexpr float kSmallestArea = 1e-9f;  // px^2

// Corners of eight triangles, in the buffer's coordinates.
struct EightCorners {
  Eight x[3], y[3], z[3];
};

// What lies beyond `end` is taken for the last before it.
CALIPSO_INLINE EightCorners cornersOf(const ScreenMesh& mesh, int first, int end,
                                      const cv::Rect& region) {
  const float* at[3][8];
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3i& t = (*mesh.triangles)[first + k < end ? first + k : end - 1];
    for (int i = 0; i < 3; ++i) at[i][k] = mesh.points[t[i]].data();
  }
  EightCorners p;
  for (int i = 0; i < 3; ++i) {
    const auto gathered = [&](int c) {
      return Eight{at[i][0][c], at[i][1][c], at[i][2][c], at[i][3][c],
                   at[i][4][c], at[i][5][c], at[i][6][c], at[i][7][c]};
    };
    p.x[i] = gathered(0) - static_cast<float>(region.x);
    p.y[i] = gathered(1) - static_cast<float>(region.y);
    p.z[i] = gathered(2);
  }
  return p;
}

// Of pixels whose coordinate is in [low - tolerance, high + tolerance]: the first and the last that
// the buffer has. @param last of the buffer. @return -1 where there are any
CALIPSO_INLINE EightInts limitsOf(const Eight (&x)[3], int last, EightInts& from, EightInts& to) {
  const Eight low = smaller(smaller(x[0], x[1]), x[2]), high = larger(larger(x[0], x[1]), x[2]),
              end = all(static_cast<float>(last));
  const Eight first_x = larger(low - kEdgeTolerance, Eight{}),
              last_x = smaller(high + kEdgeTolerance, end);
  from = __builtin_convertvector(first_x, EightInts),
  to = __builtin_convertvector(last_x, EightInts);
  from -= __builtin_convertvector(from, Eight) < first_x;
  to += __builtin_convertvector(to, Eight) > last_x;
  return (high >= 0.0f) & (low <= end) & (from <= to);
}

// The members of TriangleSpan of eight triangles.
struct EightSpans {
  Eight edge_u[3], edge_v[3], edge_0[3], near_u, near_v, near_0;
  EightInts row_min, row_max, column_min, column_max, wanted;  // 0 = not to be drawn
};

CALIPSO_INLINE EightSpans spansOf(const EightCorners& p, int hidden_side, const cv::Rect& region) {
  EightSpans s;
  const Eight dx1 = p.x[1] - p.x[0], dx2 = p.x[2] - p.x[0], dy1 = p.y[1] - p.y[0],
              dy2 = p.y[2] - p.y[0], area = dx1 * dy2 - dx2 * dy1;
  const Eight depths = p.z[0] + p.z[1] + p.z[2];  // NaN: one cannot be projected
  const EightInts within = limitsOf(p.x, region.width - 1, s.column_min, s.column_max) &
                           limitsOf(p.y, region.height - 1, s.row_min, s.row_max);
  s.wanted = within & ~(static_cast<float>(hidden_side) * area > 0.0f) &
             (larger(area, -area) > kSmallestArea) & (depths == depths);
  const Eight inwards = area > 0.0f ? all(1.0f) : all(-1.0f),
              top = __builtin_convertvector(s.row_min, Eight),
              left = __builtin_convertvector(s.column_min, Eight);
  for (int i = 0; i < 3; ++i) {  // edge functions, moved out by kEdgeTolerance
    const Eight dx = p.x[(i + 1) % 3] - p.x[i], dy = p.y[(i + 1) % 3] - p.y[i];
    s.edge_u[i] = -inwards * dy, s.edge_v[i] = inwards * dx;
    s.edge_0[i] = inwards * (dx * (top - p.y[i]) - dy * (left - p.x[i])) +
                  kEdgeTolerance * squareRoot(dx * dx + dy * dy);
  }
  const Eight dz1 = p.z[1] - p.z[0], dz2 = p.z[2] - p.z[0], per_area = 1.0f / area;
  s.near_u = (dz1 * dy2 - dz2 * dy1) * per_area, s.near_v = (dz2 * dx1 - dz1 * dx2) * per_area;
  s.near_0 = p.z[0] - s.near_u * p.x[0] - s.near_v * p.y[0];
  return s;
}

CALIPSO_INLINE int makeSpansBody(const ScreenMesh& mesh, int begin, int end, std::uint32_t object,
                                 const cv::Rect& region, TriangleSpan* out) {
  TriangleSpan* next = out;
  for (int first = begin; first < end; first += 8) {
    const EightSpans s = spansOf(cornersOf(mesh, first, end, region), mesh.hidden_side, region);
    if (!any(s.wanted)) continue;
    for (int k = 0; k < 8 && first + k < end; ++k) {
      if (s.wanted[k] == 0) continue;
      *next++ = {{s.edge_u[0][k], s.edge_u[1][k], s.edge_u[2][k], 0.0f},
                 {s.edge_v[0][k], s.edge_v[1][k], s.edge_v[2][k], 0.0f},
                 {s.edge_0[0][k], s.edge_0[1][k], s.edge_0[2][k], 0.0f},
                 s.near_u[k],
                 s.near_v[k],
                 s.near_0[k],
                 s.row_min[k],
                 s.row_max[k],
                 s.column_min[k],
                 s.column_max[k],
                 object | static_cast<std::uint32_t>(first + k)};
    }
  }
  return static_cast<int>(next - out);
}

}  // namespace calipso::render
