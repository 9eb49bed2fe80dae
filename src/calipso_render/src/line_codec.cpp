#include "line_codec.hpp"

#include "calipso_render/colour.hpp"
#include "kernels.hpp"

namespace calipso::render {

LineCodec::LineCodec(const NoiseModel& noise, std::int64_t stamp_ns) : field_(stamp_ns) {
  for (int c = 0; c < 3; ++c) {
    for (int code = 0; code < 256; ++code) deviation_[code][c] = noise.deviation(c, static_cast<float>(code));
  }
}

void LineCodec::encode(const cv::Vec4f* colours, int u, int v, int count, cv::Vec3b* codes) const {
  const CodeTables tables{encodeTables().code.data(), encodeTables().rise.data(), deviation_[0].val};
  kernels().encode(tables, colours, field_.row(v), field_.column(u), count, codes);
}

}  // namespace calipso::render
