#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "calipso_render/noise.hpp"
#include "draw/kernels.hpp"

namespace calipso::render {

// Linear colours to code values with the camera's noise, a stretch of a row at a time.
class LineCodec {
 public:
  // @param noise of the camera; a model without deviations adds none
  LineCodec(const NoiseModel& noise, std::int64_t stamp_ns);

  // @param colour linear B, G, R, the part of the pixel that carries no noise yet, and the
  // deviation that its noise has at least, code values; up to seven more are read.
  // @param u, v the first pixel's place in the picture
  void encode(const float* const (&colour)[5], int u, int v, int count, cv::Vec3b* codes) const;

 private:
  NoiseCurves curves_;
  NoiseField field_;
};

}  // namespace calipso::render
