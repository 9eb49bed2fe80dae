#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "calipso_render/edge_coverage.hpp"
#include "calipso_render/rasterizer.hpp"
#include "draw/shadow_texels.hpp"
#include "draw/surface_run.hpp"
#include "draw/triangle_map.hpp"
#include "draw/triangle_span.hpp"

namespace calipso::render {

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
  // Part of the light that `count` points see: the mean height of the blockers within the cone that
  // the light's disc spans up to the highest, then the covered part of the penumbra that it sets
  // (Fernando 2005).
  void (*visible)(const ShadowTexels& map, const ShadowTaps& taps, const LightPoints& points,
                  int count, float* visible);

  // What a stretch of pixels shows, by their triangles' maps: all of a run but `sun` and `colour`,
  // from its `column`. What is told of thin triangles is of no use.
  // @param ids of the pixels' triangles; seven more are read
  // @return TriangleMap::traits that any of the triangles has
  unsigned (*locate)(const TriangleMap* maps, const std::uint32_t* ids, const PixelStretch& stretch,
                     const SightLines& sight, SurfaceRun& run);

  // Reflectance of places [first, last) of a run by sampleBicubic(). @param image CV_32FC4, not
  // empty
  void (*sample)(const cv::Mat& image, int first, int last, SurfaceRun& run);

  // Radiance of places [first, last) of a run from their reflectance. Up to seven on each side are
  // changed, too.
  void (*shade)(const SurfaceShade& shade, int first, int last, SurfaceRun& run);

  // Code values of `count` linear colours, with noise. Up to seven more are read.
  // @param colour linear B, G, R, the part of the pixel that carries no noise yet, and the
  // deviation that its noise has at least, code values
  // @param column of the first in the rows of noise, which are read around their end
  void (*encode)(const NoiseCurves& curves, const float* const (&colour)[5], const NoiseRows& noise,
                 int column, int count, cv::Vec3b* codes);

  // Makes the triangles [begin, end) of a mesh ready to be filled that a buffer over `region` can
  // see. @param object bits of the triangles' ids. @param out room for all. @return how many
  int (*makeSpans)(const ScreenMesh& mesh, int begin, int end, std::uint32_t object,
                   const cv::Rect& region, TriangleSpan* out);

  // Draws the `count` triangles of `spans` that `which` numbers, in that order.
  void (*fill)(const TriangleSpan* spans, const int* which, int count, const SpanTarget& target);

  // Draws a triangle into the samples of a square's pixels. @param pixels that the square names
  void (*drawSamples)(const TriangleSamples& t, const SampledTile& tile, std::uint32_t id,
                      EdgeCoverage::Pixel* pixels);
};

const Kernels& plainKernels();
const Kernels* avx2Kernels();  // nullptr: not on this processor
const Kernels& kernels();      // the best of them

}  // namespace calipso::render
