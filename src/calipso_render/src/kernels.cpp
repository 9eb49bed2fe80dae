#include "kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "bicubic.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/noise.hpp"
#include "raster_bodies.hpp"

namespace calipso::render {
namespace {

constexpr float kUp = 16384.0f;  // makes the truncation to int a floor
constexpr int kDown = 16384;

// Sum in a fixed order, whatever the width of a register.
CALIPSO_INLINE float sumOf(const Eight& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

CALIPSO_INLINE Eight gather(const float* from, const EightInts& at) {
  return Eight{from[at[0]], from[at[1]], from[at[2]], from[at[3]],
               from[at[4]], from[at[5]], from[at[6]], from[at[7]]};
}

// Where the texels (i, j) are in the map; the corner for those outside [0, right) x [0, bottom).
CALIPSO_INLINE EightInts texelsAt(const ShadowTexels& map, const EightInts& i, const EightInts& j,
                                  int right, int bottom) {
  return (j * map.stride + i) & (i >= 0) & (j >= 0) & (i < right) & (j < bottom);
}

CALIPSO_INLINE float visibleThroughBody(const ShadowTexels& map, const ShadowTaps& taps, float s,
                                        float t, float h, float search) {
  Eight above{}, hits{};
  for (int k = 0; k < taps.count; k += 8) {
    const Eight x = s + search * *reinterpret_cast<const Eight*>(&taps.x[k]) + (kUp + 0.5f),
                y = t + search * *reinterpret_cast<const Eight*>(&taps.y[k]) + (kUp + 0.5f);
    const EightInts i = __builtin_convertvector(x, EightInts) - kDown,
                    j = __builtin_convertvector(y, EightInts) - kDown;
    const Eight over = gather(map.heights, texelsAt(map, i, j, map.width, map.height)) - h;
    const EightInts blocks = over > 0.0f;
    above += blocks ? over : Eight{}, hits += blocks ? Eight{} + 1.0f : Eight{};
  }
  const float blockers = sumOf(hits);
  if (blockers == 0.0f) return 1.0f;
  const float radius = std::max(1.0f, map.spread * sumOf(above) / blockers);
  Eight covered{};
  for (int k = 0; k < taps.count; k += 8) {
    const Eight x = s + radius * *reinterpret_cast<const Eight*>(&taps.x[k]),
                y = t + radius * *reinterpret_cast<const Eight*>(&taps.y[k]);
    const EightInts i = __builtin_convertvector(x + kUp, EightInts) - kDown,
                    j = __builtin_convertvector(y + kUp, EightInts) - kDown;
    const Eight fx = x - __builtin_convertvector(i, Eight),
                fy = y - __builtin_convertvector(j, Eight);
    const EightInts at = texelsAt(map, i, j, map.width - 1, map.height - 1);
    const Eight one = Eight{} + 1.0f, none{};
    const Eight a = gather(map.heights, at) > h ? one : none,
                b = gather(map.heights + 1, at) > h ? one : none;
    const Eight c = gather(map.heights + map.stride, at) > h ? one : none,
                e = gather(map.heights + map.stride + 1, at) > h ? one : none;
    covered += (a + (b - a) * fx) * (1.0f - fy) + (c + (e - c) * fx) * fy;
  }
  return 1.0f - sumOf(covered) / static_cast<float>(taps.count);
}

typedef std::int32_t LaneChoice __attribute__((vector_size(32)));

CALIPSO_INLINE Eight& eightAt(float* at) { return *reinterpret_cast<Eight*>(at); }
CALIPSO_INLINE const Eight& eightAt(const float* at) { return *reinterpret_cast<const Eight*>(at); }

CALIPSO_INLINE void locateBody(const TriangleMap* maps, const std::uint32_t* ids, int u, int v,
                               int count, const cv::Point& corner, float* key_u, float* key_v) {
  const Eight lanes = {0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 7.0f};
  const float left = static_cast<float>(corner.x), top = static_cast<float>(corner.y);
  for (int k = 0; k < count;) {
    const std::uint32_t id = ids[k];
    const TriangleMap& map = maps[VisibilityBuffer::triangleOf(id)];
    const float dv = static_cast<float>(v) - map.v;
    const Four start = *reinterpret_cast<const Four*>(map.key[0]) +
                       *reinterpret_cast<const Four*>(map.key[2]) * dv;
    const float* rise = map.key[1];
    do {
      const Eight du = static_cast<float>(u + k) - map.u + lanes,
                  scale = 1.0f / (start[2] + rise[2] * du);
      eightAt(key_u + k) = (start[0] + rise[0] * du) * scale - left;
      eightAt(key_v + k) = (start[1] + rise[1] * du) * scale - top;
      const int end = std::min(k + 8, count);
      while (k < end && ids[k] == id) ++k;
    } while (k < count && ids[k] == id);
  }
}

// Sums of a place's taps in even (B, G, R, _) and odd columns (B, G, R, _).
// @pre 1 <= u < columns - 2, likewise v
CALIPSO_INLINE Eight bicubicSums(const cv::Mat& image, std::size_t step, float u, float v) {
  const int i = static_cast<int>(u), j = static_cast<int>(v);
  const float t = u - static_cast<float>(i), s = v - static_cast<float>(j);
  const Eight a01 = {0.0f, 0.0f, 0.0f, 0.0f, 1.0f, 1.0f, 1.0f, 1.0f},
              b01 = {-0.5f, -0.5f, -0.5f, -0.5f},
              c01 = {1.0f, 1.0f, 1.0f, 1.0f, -2.5f, -2.5f, -2.5f, -2.5f};
  const Eight d01 = {-0.5f, -0.5f, -0.5f, -0.5f, 1.5f, 1.5f, 1.5f, 1.5f},
              b23 = {0.5f, 0.5f, 0.5f, 0.5f},
              c23 = {2.0f, 2.0f, 2.0f, 2.0f, -0.5f, -0.5f, -0.5f, -0.5f},
              d23 = {-1.5f, -1.5f, -1.5f, -1.5f, 0.5f, 0.5f, 0.5f, 0.5f};
  const Eight first = a01 + t * (b01 + t * (c01 + t * d01)),
              second = t * (b23 + t * (c23 + t * d23));
  const Four a = {0.0f, 1.0f, 0.0f, 0.0f}, b = {-0.5f, 0.0f, 0.5f, 0.0f},
             c = {1.0f, -2.5f, 2.0f, -0.5f}, d = {-0.5f, 1.5f, -1.5f, 0.5f};
  const Four wy = a + s * (b + s * (c + s * d));
  const float* p = image.ptr<float>(j - 1) + 4 * (i - 1);
  const auto line = [&](int r) {
    return wy[r] * (first * eightAt(p + r * step) + second * eightAt(p + r * step + 8));
  };
  return (line(0) + line(1)) + (line(2) + line(3));
}

CALIPSO_INLINE void sampleBody(const cv::Mat& image, const float* us, const float* vs, int count,
                               cv::Vec4f* out) {
  const std::size_t step = image.step1();
  const float right = static_cast<float>(image.cols) - 2.0f,
              bottom = static_cast<float>(image.rows) - 2.0f;
  const auto isInside = [&](int k) {
    return (us[k] >= 1.0f) & (vs[k] >= 1.0f) & (us[k] < right) & (vs[k] < bottom);
  };
  int k = 0;
  while (k < count) {
    if (k + 1 < count && isInside(k) && isInside(k + 1)) {
      const Eight a = bicubicSums(image, step, us[k], vs[k]),
                  b = bicubicSums(image, step, us[k + 1], vs[k + 1]);
      const Eight sum = __builtin_shuffle(a, b, LaneChoice{0, 1, 2, 3, 8, 9, 10, 11}) +
                        __builtin_shuffle(a, b, LaneChoice{4, 5, 6, 7, 12, 13, 14, 15});
      eightAt(out[k].val) = sum > 0.0f ? sum : Eight{};
      k += 2;
    } else {
      cv::v_store(out[k].val, bicubic(image, us[k], vs[k]));
      ++k;
    }
  }
}

CALIPSO_INLINE Eight squareRoot(const Eight& x) {
  Eight root;
  for (int k = 0; k < 8; ++k) root[k] = std::sqrt(x[k]);
  return root;
}

// codeFromLinear(); what is no number becomes 0.
CALIPSO_INLINE Eight codesOf(const Eight& linear) {
  const Eight one = Eight{} + 1.0f, positive = linear > 0.0f ? linear : Eight{},
              x = positive < one ? positive : one;
  const Eight root = squareRoot(squareRoot(x));
  Eight curve = Eight{} + kCurve[6];
  for (int k = 5; k >= 0; --k) curve = curve * root + kCurve[k];
  return x > kStraight ? curve : kStraightRise * x;
}

// With noise of unit variance, rounded.
CALIPSO_INLINE EightInts noisyCodes(const Eight& linear, const Eight& fresh, const float* start,
                                    const float* rise, const float* noise) {
  const Eight code = codesOf(linear);
  const LaneChoice piece = __builtin_convertvector(code * (1.0f / 32.0f), LaneChoice);
  const Eight deviation =
      __builtin_shuffle(eightAt(start), piece) + __builtin_shuffle(eightAt(rise), piece) * code;
  const Eight x = code + fresh * deviation * eightAt(noise), most = Eight{} + 255.0f;
  const Eight positive = x > 0.0f ? x : Eight{};
  return __builtin_convertvector((positive < most ? positive : most) + 0.5f, EightInts);
}

// Code values of eight colours.
CALIPSO_INLINE void encodeEight(const NoiseCurves& curves, const float* colours,
                                const NoiseRows& noise, int column, std::uint8_t* codes) {
  typedef std::uint8_t Bytes __attribute__((vector_size(32)));
  const Eight a = eightAt(colours), b = eightAt(colours + 8), c = eightAt(colours + 16),
              d = eightAt(colours + 24);
  // Channels of places 0, 2, 1, 3, and of 4, 6, 5, 7; then of all.
  const LaneChoice low = {0, 8, 1, 9, 4, 12, 5, 13}, high = {2, 10, 3, 11, 6, 14, 7, 15},
                   in_order = {0, 4, 1, 5, 2, 6, 3, 7};
  const Eight bg = __builtin_shuffle(a, b, low), rf = __builtin_shuffle(a, b, high),
              bg4 = __builtin_shuffle(c, d, low), rf4 = __builtin_shuffle(c, d, high);
  const LaneChoice halves = {0, 1, 8, 9, 4, 5, 12, 13}, others = {2, 3, 10, 11, 6, 7, 14, 15};
  const auto channel = [&](const Eight& x, const Eight& y, const LaneChoice& which) {
    return __builtin_shuffle(__builtin_shuffle(x, y, which), in_order);
  };
  const Eight fresh = channel(rf, rf4, others);
  const EightInts blue = noisyCodes(channel(bg, bg4, halves), fresh, curves.start[0],
                                    curves.rise[0], noise.channel[0] + column);
  const EightInts green = noisyCodes(channel(bg, bg4, others), fresh, curves.start[1],
                                     curves.rise[1], noise.channel[1] + column);
  const EightInts red = noisyCodes(channel(rf, rf4, halves), fresh, curves.start[2], curves.rise[2],
                                   noise.channel[2] + column);
  const Bytes bytes = (Bytes)(blue | (green << 8) | (red << 16));
  const Bytes packed = __builtin_shuffle(
      bytes, Bytes{0,  1,  2,  4,  5,  6,  8,  9,  10, 12, 13, 14, 3,  7,  11, 15,
                   16, 17, 18, 20, 21, 22, 24, 25, 26, 28, 29, 30, 19, 23, 27, 31});
  std::memcpy(codes, &packed, 12),
      std::memcpy(codes + 12, reinterpret_cast<const std::uint8_t*>(&packed) + 16, 12);
}

CALIPSO_INLINE void encodeBody(const NoiseCurves& curves, const cv::Vec4f* colours,
                               const NoiseRows& noise, int column, int count, cv::Vec3b* codes) {
  constexpr int kSide = NoiseField::kSide;
  for (; count >= 8; colours += 8, codes += 8, count -= 8, column = (column + 8) % kSide)
    encodeEight(curves, colours->val, noise, column, codes->val);
  if (count == 0) return;
  cv::Vec4f rest[8];
  cv::Vec3b rest_codes[8];
  std::copy_n(colours, count, rest);
  encodeEight(curves, rest[0].val, noise, column, rest_codes[0].val);
  std::copy_n(rest_codes, count, codes);
}

CALIPSO_INLINE void fillBody(const TriangleSpan* spans, int count, const SpanTarget& target) {
  if (target.ids != nullptr)
    fillSpansBody<true>(spans, count, target);
  else
    fillSpansBody<false>(spans, count, target);
}

#define CALIPSO_KERNELS(name, attribute)                                                         \
  attribute float name##VisibleThrough(const ShadowTexels& map, const ShadowTaps& taps, float s, \
                                       float t, float h, float search) {                         \
    return visibleThroughBody(map, taps, s, t, h, search);                                       \
  }                                                                                              \
  attribute void name##Locate(const TriangleMap* maps, const std::uint32_t* ids, int u, int v,   \
                              int count, const cv::Point& corner, float* key_u, float* key_v) {  \
    locateBody(maps, ids, u, v, count, corner, key_u, key_v);                                    \
  }                                                                                              \
  attribute void name##Sample(const cv::Mat& image, const float* u, const float* v, int count,   \
                              cv::Vec4f* out) {                                                  \
    sampleBody(image, u, v, count, out);                                                         \
  }                                                                                              \
  attribute void name##Encode(const NoiseCurves& curves, const cv::Vec4f* colours,               \
                              const NoiseRows& noise, int column, int count, cv::Vec3b* codes) { \
    encodeBody(curves, colours, noise, column, count, codes);                                    \
  }                                                                                              \
  attribute void name##Fill(const TriangleSpan* spans, int count, const SpanTarget& target) {    \
    fillBody(spans, count, target);                                                              \
  }                                                                                              \
  attribute void name##DrawSamples(const TriangleSamples& t, int u, int v, std::uint32_t id,     \
                                   EdgeCoverage::Pixel& pixel) {                                 \
    drawSamplesBody(t, u, v, id, pixel);                                                         \
  }                                                                                              \
  const Kernels name##Table{name##VisibleThrough, name##Locate, name##Sample,                    \
                            name##Encode,         name##Fill,   name##DrawSamples};

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
