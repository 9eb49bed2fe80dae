#include "frame/line_codec.hpp"

#include <algorithm>

namespace calipso::render {

LineCodec::LineCodec(const NoiseModel& noise, std::int64_t stamp_ns) : field_(noise, stamp_ns) {
  constexpr float step = NoiseModel::kKnotStep;
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k + 1 < NoiseModel::kKnots; ++k) {
      const float code = step * static_cast<float>(k), here = noise.deviation(c, code),
                  next = noise.deviation(c, code + step);
      curves_.rise[c][k] = (next - here) / (std::min(code + step, 255.0f) - code);
      curves_.start[c][k] = here - curves_.rise[c][k] * code;
    }
  }
}

void LineCodec::encode(const float* const (&colour)[5], int u, int v, int count,
                       cv::Vec3b* codes) const {
  kernels().encode(curves_, colour, {field_.row(v, 0), field_.row(v, 1), field_.row(v, 2)},
                   field_.column(u), count, codes);
}

}  // namespace calipso::render
