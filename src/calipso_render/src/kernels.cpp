#include "kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "bicubic.hpp"
#include "calipso_render/colour.hpp"
#include "raster_bodies.hpp"

namespace calipso::render {
namespace {

constexpr float kUp = 16384.0f;  // makes the truncation to int a floor
constexpr int kDown = 16384;

// Sum in a fixed order, whatever the width of a register.
CALIPSO_INLINE float sumOf(const Eight& x) { return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7])); }

CALIPSO_INLINE Eight gather(const float* from, const EightInts& at) {
  return Eight{from[at[0]], from[at[1]], from[at[2]], from[at[3]], from[at[4]], from[at[5]], from[at[6]], from[at[7]]};
}

// Where the texels (i, j) are in the map; the corner for those outside [0, right) x [0, bottom).
CALIPSO_INLINE EightInts texelsAt(const ShadowTexels& map, const EightInts& i, const EightInts& j, int right, int bottom) {
  return (j * map.stride + i) & (i >= 0) & (j >= 0) & (i < right) & (j < bottom);
}

CALIPSO_INLINE float visibleThroughBody(const ShadowTexels& map, const ShadowTaps& taps, float s, float t, float h, float search) {
  Eight above{}, hits{};
  for (int k = 0; k < taps.count; k += 8) {
    const Eight x = s + search * *reinterpret_cast<const Eight*>(&taps.x[k]) + (kUp + 0.5f), y = t + search * *reinterpret_cast<const Eight*>(&taps.y[k]) + (kUp + 0.5f);
    const EightInts i = __builtin_convertvector(x, EightInts) - kDown, j = __builtin_convertvector(y, EightInts) - kDown;
    const Eight over = gather(map.heights, texelsAt(map, i, j, map.width, map.height)) - h;
    const EightInts blocks = over > 0.0f;
    above += blocks ? over : Eight{}, hits += blocks ? Eight{} + 1.0f : Eight{};
  }
  const float blockers = sumOf(hits);
  if (blockers == 0.0f) return 1.0f;
  const float radius = std::max(1.0f, map.spread * sumOf(above) / blockers);
  Eight covered{};
  for (int k = 0; k < taps.count; k += 8) {
    const Eight x = s + radius * *reinterpret_cast<const Eight*>(&taps.x[k]), y = t + radius * *reinterpret_cast<const Eight*>(&taps.y[k]);
    const EightInts i = __builtin_convertvector(x + kUp, EightInts) - kDown, j = __builtin_convertvector(y + kUp, EightInts) - kDown;
    const Eight fx = x - __builtin_convertvector(i, Eight), fy = y - __builtin_convertvector(j, Eight);
    const EightInts at = texelsAt(map, i, j, map.width - 1, map.height - 1);
    const Eight one = Eight{} + 1.0f, none{};
    const Eight a = gather(map.heights, at) > h ? one : none, b = gather(map.heights + 1, at) > h ? one : none;
    const Eight c = gather(map.heights + map.stride, at) > h ? one : none, e = gather(map.heights + map.stride + 1, at) > h ? one : none;
    covered += (a + (b - a) * fx) * (1.0f - fy) + (c + (e - c) * fx) * fy;
  }
  return 1.0f - sumOf(covered) / static_cast<float>(taps.count);
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

// Bytes of B, G, R, _ to B, G, R.
CALIPSO_INLINE void packCodes(const std::int32_t* levels, int count, std::uint8_t* codes) {
  typedef std::int32_t SixteenInts __attribute__((vector_size(64), aligned(4), may_alias));
  typedef std::uint8_t SixteenBytes __attribute__((vector_size(16)));
  int k = 0;
  for (; k + 4 <= count; k += 4) {
    const SixteenBytes bytes = __builtin_convertvector(*reinterpret_cast<const SixteenInts*>(levels + 4 * k), SixteenBytes);
    const SixteenBytes packed = __builtin_shuffle(bytes, SixteenBytes{0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, 3, 7, 11, 15});
    std::memcpy(codes + 3 * k, &packed, 12);
  }
  for (; k < count; ++k) {
    for (int c = 0; c < 3; ++c) codes[3 * k + c] = static_cast<std::uint8_t>(levels[4 * k + c]);
  }
}

CALIPSO_INLINE void encodeStretch(const CodeTables& tables, const float* colours, const float* noise, int count, std::uint8_t* codes) {
  alignas(32) float part[4 * kStretch], code[4 * kStretch], fresh[4 * kStretch];
  alignas(32) std::int32_t step[4 * kStretch];
  const int n = 4 * count;
  // As codeFromLinear(); what is no number becomes 0.
  for (int k = 0; k < n; ++k) {
    const float positive = colours[k] > 0.0f ? colours[k] : 0.0f;
    const float x = std::sqrt(positive < 1.0f ? positive : 1.0f) * kEncodeSteps;
    step[k] = static_cast<std::int32_t>(x);
    part[k] = x - static_cast<float>(step[k]);
  }
  for (int k = 0; k < n; ++k) code[k] = tables.code[step[k]] + part[k] * tables.rise[step[k]];
  for (int k = 0; k < count; ++k) {
    for (int c = 0; c < 4; ++c) fresh[4 * k + c] = colours[4 * k + 3];
  }
  for (int k = 0; k < n; ++k) {
    const float deviation = tables.deviation[4 * static_cast<std::int32_t>(code[k] + 0.5f) + (k & 3)];
    const float x = code[k] + fresh[k] * deviation * noise[k];
    const float positive = x > 0.0f ? x : 0.0f;
    step[k] = static_cast<std::int32_t>((positive < 255.0f ? positive : 255.0f) + 0.5f);
  }
  packCodes(step, count, codes);
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
