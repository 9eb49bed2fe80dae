#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "calipso_render/edge_coverage.hpp"
#include "triangle_map.hpp"
#include "triangle_span.hpp"

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
};

// The camera's noise: per channel its deviation, start + rise * code, in eight pieces of 32 code
// values.
struct NoiseCurves {
  alignas(32) float start[3][8], rise[3][8];
};

// Per channel a row of NoiseField.
struct NoiseRows {
  const float* channel[3];
};

// Loops over which a frame spends its time, compiled for the processors that the build is for and
// for those with AVX2. Both give the same bits: nothing is contracted or summed in another order.
struct Kernels {
  // Part of the light that a receiver at (s, t), texels, and height h sees: the mean height of the
  // blockers within `search`, then the covered part of the penumbra that it sets (Fernando 2005).
  float (*visibleThrough)(const ShadowTexels& map, const ShadowTaps& taps, float s, float t,
                          float h, float search);

  // The key picture's places that pixels (u + k, v), k < count, show, by their triangles' maps. Up
  // to seven places more are written.
  // @param ids of the pixels' triangles; corner of the key picture
  void (*locate)(const TriangleMap* maps, const std::uint32_t* ids, int u, int v, int count,
                 const cv::Point& corner, float* key_u, float* key_v);

  // sampleBicubic() at `count` places. @param image CV_32FC4, not empty
  void (*sample)(const cv::Mat& image, const float* u, const float* v, int count, cv::Vec4f* out);

  // Code values of `count` linear colours (B, G, R, part without noise), with noise.
  // @param column of the first in the rows of noise, which are read around their end
  void (*encode)(const NoiseCurves& curves, const cv::Vec4f* colours, const NoiseRows& noise,
                 int column, int count, cv::Vec3b* codes);

  // Draws `count` triangles in their order.
  void (*fill)(const TriangleSpan* spans, int count, const SpanTarget& target);

  // Draws a triangle into the samples of pixel (u, v).
  void (*drawSamples)(const TriangleSamples& t, int u, int v, std::uint32_t id,
                      EdgeCoverage::Pixel& pixel);
};

const Kernels& plainKernels();
const Kernels* avx2Kernels();  // nullptr: not on this processor
const Kernels& kernels();      // the best of them

}  // namespace calipso::render
