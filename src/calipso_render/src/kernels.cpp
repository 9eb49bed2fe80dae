#include "kernels.hpp"

#include <algorithm>
#include <cmath>

#include "bicubic.hpp"
#include "calipso_render/colour.hpp"
#include "raster_bodies.hpp"

namespace calipso::render {
namespace {

constexpr float kUp = 16384.0f;  // makes the truncation to int a floor
constexpr int kDown = 16384;

// Sum in a fixed order, whatever the width of a register.
CALIPSO_INLINE float sumOf(float* x, int count) {
  float lanes[8] = {};
  for (int k = 0; k < count; k += 8) {
    for (int i = 0; i < 8; ++i) lanes[i] += x[k + i];
  }
  for (int i = 0; i < 4; ++i) lanes[i] += lanes[i + 4];
  return (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]);
}

CALIPSO_INLINE float visibleThroughBody(const ShadowTexels& map, const ShadowTaps& taps, float s, float t, float h, float search) {
  alignas(32) float above[ShadowTaps::kMost], hit[ShadowTaps::kMost], fx[ShadowTaps::kMost], fy[ShadowTaps::kMost];
  alignas(32) int at[ShadowTaps::kMost];
  const int n = taps.count;
  const unsigned width = static_cast<unsigned>(map.width), height = static_cast<unsigned>(map.height);
  for (int k = 0; k < n; ++k) {
    const int i = static_cast<int>(s + search * taps.x[k] + (kUp + 0.5f)) - kDown, j = static_cast<int>(t + search * taps.y[k] + (kUp + 0.5f)) - kDown;
    const bool inside = (static_cast<unsigned>(i) < width) & (static_cast<unsigned>(j) < height);
    at[k] = inside ? j * map.stride + i : 0;
  }
  for (int k = 0; k < n; ++k) above[k] = map.heights[at[k]];
  for (int k = 0; k < n; ++k) {
    const float x = above[k] - h;
    above[k] = x > 0.0f ? x : 0.0f;
    hit[k] = x > 0.0f ? 1.0f : 0.0f;
  }
  const float blockers = sumOf(hit, n);
  if (blockers == 0.0f) return 1.0f;
  const float radius = std::max(1.0f, map.spread * sumOf(above, n) / blockers);
  for (int k = 0; k < n; ++k) {
    const float x = s + radius * taps.x[k], y = t + radius * taps.y[k];
    const int i = static_cast<int>(x + kUp) - kDown, j = static_cast<int>(y + kUp) - kDown;
    const bool inside = (static_cast<unsigned>(i) < width - 1) & (static_cast<unsigned>(j) < height - 1);
    fx[k] = x - static_cast<float>(i), fy[k] = y - static_cast<float>(j);
    at[k] = inside ? j * map.stride + i : 0;
  }
  for (int k = 0; k < n; ++k) {
    const float* row = map.heights + at[k];
    const float a = row[0] > h, b = row[1] > h, c = row[map.stride] > h, e = row[map.stride + 1] > h;
    hit[k] = (a + (b - a) * fx[k]) * (1.0f - fy[k]) + (c + (e - c) * fx[k]) * fy[k];
  }
  return 1.0f - sumOf(hit, n) / static_cast<float>(n);
}

CALIPSO_INLINE void sampleBody(const cv::Mat& image, const float* us, const float* vs, int count, cv::Vec4f* out) {
  const std::size_t step = image.step1();
  const float right = static_cast<float>(image.cols) - 2.0f, bottom = static_cast<float>(image.rows) - 2.0f;
  for (int k = 0; k < count; ++k) {
    const float u = us[k], v = vs[k];
    if (!((u >= 1.0f) & (v >= 1.0f) & (u < right) & (v < bottom))) {
      cv::v_store(out[k].val, bicubic(image, u, v));
      continue;
    }
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const Four a = {0.0f, 1.0f, 0.0f, 0.0f}, b = {-0.5f, 0.0f, 0.5f, 0.0f}, c = {1.0f, -2.5f, 2.0f, -0.5f}, d = {-0.5f, 1.5f, -1.5f, 0.5f};
    const float tx = u - static_cast<float>(i), ty = v - static_cast<float>(j);
    const Four wx = a + tx * (b + tx * (c + tx * d)), wy = a + ty * (b + ty * (c + ty * d));
    const Eight first = {wx[0], wx[0], wx[0], wx[0], wx[1], wx[1], wx[1], wx[1]}, second = {wx[2], wx[2], wx[2], wx[2], wx[3], wx[3], wx[3], wx[3]};
    const float* p = image.ptr<float>(j - 1) + 4 * (i - 1);
    Eight line[4];
    for (int r = 0; r < 4; ++r) {
      const float* row = p + r * step;
      line[r] = wy[r] * (first * *reinterpret_cast<const Eight*>(row) + second * *reinterpret_cast<const Eight*>(row + 8));
    }
    const Eight sum = (line[0] + line[1]) + (line[2] + line[3]);
    for (int ch = 0; ch < 4; ++ch) {
      const float x = sum[ch] + sum[ch + 4];
      out[k][ch] = x > 0.0f ? x : 0.0f;
    }
  }
}

constexpr int kStretch = 64;  // pixels encoded at a time

CALIPSO_INLINE void encodeStretch(const CodeTables& tables, const float* colours, const float* noise, int count, std::uint8_t* codes) {
  alignas(32) float part[4 * kStretch], code[4 * kStretch], deviation[4 * kStretch];
  alignas(32) int step[4 * kStretch];
  const int n = 4 * count;
  // As codeFromLinear(); what is no number becomes 0.
  for (int k = 0; k < n; ++k) {
    const float positive = colours[k] > 0.0f ? colours[k] : 0.0f;
    const float x = std::sqrt(positive < 1.0f ? positive : 1.0f) * kEncodeSteps;
    step[k] = static_cast<int>(x);
    part[k] = x - static_cast<float>(step[k]);
  }
  for (int k = 0; k < n; ++k) code[k] = tables.code[step[k]] + part[k] * tables.rise[step[k]];
  for (int k = 0; k < count; ++k) {
    const float fresh = colours[4 * k + 3];
    for (int c = 0; c < 3; ++c) deviation[4 * k + c] = fresh * tables.deviation[c][static_cast<int>(code[4 * k + c] + 0.5f)];
    deviation[4 * k + 3] = 0.0f;
  }
  for (int k = 0; k < n; ++k) {
    const float x = code[k] + deviation[k] * noise[k];
    const float positive = x > 0.0f ? x : 0.0f;
    step[k] = static_cast<int>((positive < 255.0f ? positive : 255.0f) + 0.5f);
  }
  for (int k = 0; k < count; ++k) {
    for (int c = 0; c < 3; ++c) codes[3 * k + c] = static_cast<std::uint8_t>(step[4 * k + c]);
  }
}

CALIPSO_INLINE void encodeBody(const CodeTables& tables, const cv::Vec4f* colours, const cv::Vec4f* noise, int column, int count, cv::Vec3b* codes) {
  constexpr int kSide = 256;
  while (count > 0) {
    const int n = std::min({count, kStretch, kSide - column});
    encodeStretch(tables, colours->val, noise[column].val, n, reinterpret_cast<std::uint8_t*>(codes));
    colours += n, codes += n, count -= n, column = (column + n) % kSide;
  }
}

CALIPSO_INLINE void fillBody(const TriangleSpan* spans, int count, const SpanTarget& target) {
  if (target.ids != nullptr) fillSpansBody<true>(spans, count, target);
  else fillSpansBody<false>(spans, count, target);
}

#define CALIPSO_KERNELS(name, attribute)                                                                                             \
  attribute float name##VisibleThrough(const ShadowTexels& map, const ShadowTaps& taps, float s, float t, float h, float search) {   \
    return visibleThroughBody(map, taps, s, t, h, search);                                                                           \
  }                                                                                                                                  \
  attribute void name##Sample(const cv::Mat& image, const float* u, const float* v, int count, cv::Vec4f* out) {                     \
    sampleBody(image, u, v, count, out);                                                                                             \
  }                                                                                                                                  \
  attribute void name##Encode(const CodeTables& tables, const cv::Vec4f* colours, const cv::Vec4f* noise, int column, int count,     \
                              cv::Vec3b* codes) {                                                                                    \
    encodeBody(tables, colours, noise, column, count, codes);                                                                        \
  }                                                                                                                                  \
  attribute void name##Fill(const TriangleSpan* spans, int count, const SpanTarget& target) { fillBody(spans, count, target); }      \
  attribute void name##DrawSamples(const TriangleSamples& t, int u, int v, std::uint32_t id, EdgeCoverage::Pixel& pixel) {           \
    drawSamplesBody(t, u, v, id, pixel);                                                                                             \
  }                                                                                                                                  \
  const Kernels name##Table{name##VisibleThrough, name##Sample, name##Encode, name##Fill, name##DrawSamples};

CALIPSO_KERNELS(plain, )
#if defined(__x86_64__) && defined(__GNUC__)
#define CALIPSO_AVX2 __attribute__((target("avx2")))
CALIPSO_KERNELS(avx2, CALIPSO_AVX2)
#endif

}  // namespace

const Kernels& plainKernels() { return plainTable; }

const Kernels* avx2Kernels() {
#ifdef CALIPSO_AVX2
  return __builtin_cpu_supports("avx2") ? &avx2Table : nullptr;
#else
  return nullptr;
#endif
}

const Kernels& kernels() {
  static const Kernels& best = avx2Kernels() != nullptr ? *avx2Kernels() : plainKernels();
  return best;
}

}  // namespace calipso::render
