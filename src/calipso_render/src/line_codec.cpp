#include "line_codec.hpp"

#include <opencv2/core/hal/intrin.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {

LineCodec::LineCodec(const NoiseModel& noise, std::int64_t stamp_ns) : field_(stamp_ns) {
  for (int c = 0; c < 3; ++c) {
    for (int code = 0; code < 256; ++code) deviation_[c][code] = noise.deviation(c, static_cast<float>(code));
  }
}

void LineCodec::encode(const cv::Vec4f* colours, int u, int v, int count, cv::Vec3b* codes) const {
  const EncodeStep* steps = encodeSteps();
  const cv::Vec4f* noise = field_.row(v);
  const cv::v_float32x4 one = cv::v_setall_f32(1.0f), zero = cv::v_setzero_f32(), half = cv::v_setall_f32(0.5f), white = cv::v_setall_f32(255.0f);
  for (int k = 0; k < count; ++k) {
    const cv::v_float32x4 colour = cv::v_load(colours[k].val), fresh = cv::v_broadcast_element<3>(colour);
    // As codeFromLinear(); what is no number becomes 0.
    const cv::v_float32x4 x = cv::v_sqrt(cv::v_min(cv::v_max(colour, zero), one)) * cv::v_setall_f32(kEncodeSteps);
    const cv::v_int32x4 step = cv::v_trunc(x);
    const EncodeStep &b = steps[cv::v_extract_n<0>(step)], &g = steps[cv::v_extract_n<1>(step)], &r = steps[cv::v_extract_n<2>(step)];
    cv::v_float32x4 code = cv::v_float32x4(b.code, g.code, r.code, 0.0f) + (x - cv::v_cvt_f32(step)) * cv::v_float32x4(b.rise, g.rise, r.rise, 0.0f);
    const cv::v_int32x4 level = cv::v_trunc(code + half);
    const cv::v_float32x4 deviation(deviation_[0][cv::v_extract_n<0>(level)], deviation_[1][cv::v_extract_n<1>(level)],
                                    deviation_[2][cv::v_extract_n<2>(level)], 0.0f);
    code += fresh * deviation * cv::v_load(noise[field_.column(u + k)].val);
    const cv::v_int32x4 rounded = cv::v_trunc(cv::v_min(cv::v_max(code, zero), white) + half);
    codes[k] = cv::Vec3b(static_cast<std::uint8_t>(cv::v_extract_n<0>(rounded)), static_cast<std::uint8_t>(cv::v_extract_n<1>(rounded)),
                         static_cast<std::uint8_t>(cv::v_extract_n<2>(rounded)));
  }
}

}  // namespace calipso::render
