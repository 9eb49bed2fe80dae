#include "draw/kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "calipso_render/colour.hpp"
#include "calipso_render/noise.hpp"
#include "draw/bicubic.hpp"
#include "draw/raster_bodies.hpp"
#include "draw/shadow_bodies.hpp"
#include "draw/span_bodies.hpp"
#include "draw/surface_bodies.hpp"

namespace calipso::render {
namespace {

// Weights of the four taps along one axis, for eight places at parts t between the middle two:
// places 0 and 4, 1 and 5, 2 and 6, 3 and 7.
CALIPSO_INLINE void bicubicWeights(const Eight& t, Eight (&out)[4]) {
  const Eight w0 = t * (-0.5f + t * (1.0f + t * -0.5f)), w1 = 1.0f + t * (t * (-2.5f + t * 1.5f)),
              w2 = t * (0.5f + t * (2.0f + t * -1.5f)), w3 = t * (t * (-0.5f + t * 0.5f));
  const LaneChoice low = {0, 8, 1, 9, 4, 12, 5, 13}, high = {2, 10, 3, 11, 6, 14, 7, 15},
                   halves = {0, 1, 8, 9, 4, 5, 12, 13}, others = {2, 3, 10, 11, 6, 7, 14, 15};
  const Eight a = __builtin_shuffle(w0, w1, low), b = __builtin_shuffle(w0, w1, high),
              c = __builtin_shuffle(w2, w3, low), d = __builtin_shuffle(w2, w3, high);
  out[0] = __builtin_shuffle(a, c, halves), out[1] = __builtin_shuffle(a, c, others);
  out[2] = __builtin_shuffle(b, d, halves), out[3] = __builtin_shuffle(b, d, others);
}

// Sums of a place's taps in even (B, G, R, _) and odd columns (B, G, R, _).
// @param p its first tap; wx weights of two places, of which `upper` says which; wy its own
CALIPSO_INLINE Eight bicubicSums(const float* p, std::size_t step, const Eight& wx, const float* wy,
                                 bool upper) {
  const LaneChoice f = {0, 0, 0, 0, 1, 1, 1, 1}, s = {2, 2, 2, 2, 3, 3, 3, 3};
  const Eight first = __builtin_shuffle(wx, upper ? f + 4 : f),
              second = __builtin_shuffle(wx, upper ? s + 4 : s);
  const auto line = [&](int r) {
    return wy[r] * (first * eightAt(p + r * step) + second * eightAt(p + r * step + 8));
  };
  return (line(0) + line(1)) + (line(2) + line(3));
}

// Four times two places' B, G, R, _ -> four channels of the eight.
CALIPSO_INLINE void toPlanes(const Eight& a, const Eight& b, const Eight& c, const Eight& d,
                             Eight (&planes)[3]) {
  // Channels of places 0, 2, 1, 3, and of 4, 6, 5, 7; then of all.
  const LaneChoice low = {0, 8, 1, 9, 4, 12, 5, 13}, high = {2, 10, 3, 11, 6, 14, 7, 15},
                   in_order = {0, 4, 1, 5, 2, 6, 3, 7};
  const LaneChoice halves = {0, 1, 8, 9, 4, 5, 12, 13}, others = {2, 3, 10, 11, 6, 7, 14, 15};
  const Eight bg = __builtin_shuffle(a, b, low), bg4 = __builtin_shuffle(c, d, low);
  const Eight r = __builtin_shuffle(a, b, high), r4 = __builtin_shuffle(c, d, high);
  planes[0] = __builtin_shuffle(__builtin_shuffle(bg, bg4, halves), in_order);
  planes[1] = __builtin_shuffle(__builtin_shuffle(bg, bg4, others), in_order);
  planes[2] = __builtin_shuffle(__builtin_shuffle(r, r4, halves), in_order);
}

// Colours of eight places that lie within the image, by pairs. @pre 1 <= u < columns - 2, likewise
// v
CALIPSO_INLINE void sampleInside(const cv::Mat& image, const Eight& u, const Eight& v,
                                 Eight (&pairs)[4]) {
  const int step = static_cast<int>(image.step1());
  const EightInts i = __builtin_convertvector(u, EightInts),
                  j = __builtin_convertvector(v, EightInts);
  Eight wx[4], wy[4];
  bicubicWeights(u - __builtin_convertvector(i, Eight), wx);
  bicubicWeights(v - __builtin_convertvector(j, Eight), wy);
  const EightInts at = (j - 1) * step + 4 * (i - 1);
  const float *from = image.ptr<float>(), *rows = reinterpret_cast<const float*>(wy);
  for (int k = 0; k < 4; ++k) {
    const int m = 2 * k % 4;  // of the weights
    const bool upper = k >= 2;
    const float* weights = rows + 8 * m + (upper ? 4 : 0);
    const Eight a = bicubicSums(from + at[2 * k], step, wx[m], weights, upper),
                b = bicubicSums(from + at[2 * k + 1], step, wx[m + 1], weights + 8, upper);
    const Eight sum = __builtin_shuffle(a, b, LaneChoice{0, 1, 2, 3, 8, 9, 10, 11}) +
                      __builtin_shuffle(a, b, LaneChoice{4, 5, 6, 7, 12, 13, 14, 15});
    pairs[k] = sum > 0.0f ? sum : Eight{};
  }
}

// Asks for what the next row's stretch will read, most often a row of the image further.
inline void fetchBelow(const cv::Mat& image, float u, float v, int count) {
  if (!(u >= 1.0f && v >= 0.0f && u < image.cols && v < image.rows - 3)) return;
  const int left = static_cast<int>(u) - 1, row = static_cast<int>(v) + 3;
  for (int k = left; k < std::min(left + count + 4, image.cols); k += 4)
    __builtin_prefetch(image.ptr<cv::Vec4f>(row, k));
}

CALIPSO_INLINE void sampleBody(const cv::Mat& image, int first, int last, SurfaceRun& run) {
  const float right = static_cast<float>(image.cols) - 2.0f,
              bottom = static_cast<float>(image.rows) - 2.0f;
  fetchBelow(image, run.key_u[first], run.key_v[first], last - first);
  for (int k = first; k < last; k += 8) {
    // What lies beyond the run is taken for its first place.
    const EightInts wanted = lanes() < static_cast<float>(last - k);
    const Eight u = wanted ? eightAt(run.key_u + k) : all(run.key_u[k]),
                v = wanted ? eightAt(run.key_v + k) : all(run.key_v[k]);
    Eight pairs[4], planes[3];
    if (!any(~((u >= 1.0f) & (v >= 1.0f) & (u < right) & (v < bottom)))) {
      sampleInside(image, u, v, pairs);
    } else {
      for (int i = 0; i < 8; ++i)
        cv::v_store(reinterpret_cast<float*>(pairs) + 4 * i, bicubic(image, u[i], v[i]));
    }
    toPlanes(pairs[0], pairs[1], pairs[2], pairs[3], planes);
    for (int c = 0; c < 3; ++c) eightAt(run.colour[c] + k) = planes[c];
  }
}

// codeFromLinear(); what is no number becomes 0.
CALIPSO_INLINE Eight codesOf(const Eight& linear) {
  const Eight one = all(1.0f), positive = linear > 0.0f ? linear : Eight{},
              x = positive < one ? positive : one;
  const Eight root = squareRoot(squareRoot(x));
  Eight curve = all(kCurve[6]);
  for (int k = 5; k >= 0; --k) curve = curve * root + kCurve[k];
  return x > kStraight ? curve : kStraightRise * x;
}

// With noise of unit variance, rounded.
CALIPSO_INLINE EightInts noisyCodes(const Eight& linear, const Eight& fresh, const Eight& grain,
                                    const float* start, const float* rise, const float* noise) {
  const Eight code = codesOf(linear);
  const LaneChoice piece = __builtin_convertvector(code * (1.0f / 32.0f), LaneChoice);
  const Eight camera =
      __builtin_shuffle(eightAt(start), piece) + __builtin_shuffle(eightAt(rise), piece) * code;
  const Eight deviation = camera > grain ? camera : grain;
  const Eight x = code + fresh * deviation * eightAt(noise), most = all(255.0f);
  const Eight positive = x > 0.0f ? x : Eight{};
  return __builtin_convertvector((positive < most ? positive : most) + 0.5f, EightInts);
}

// Code values of eight colours.
CALIPSO_INLINE void encodeEight(const NoiseCurves& curves, const float* const (&colour)[5], int k,
                                const NoiseRows& noise, int column, std::uint8_t* codes) {
  typedef std::uint8_t Bytes __attribute__((vector_size(32)));
  const Eight fresh = eightAt(colour[3] + k), grain = eightAt(colour[4] + k);
  EightInts code[3];
  for (int c = 0; c < 3; ++c)
    code[c] = noisyCodes(eightAt(colour[c] + k), fresh, grain, curves.start[c], curves.rise[c],
                         noise.channel[c] + column);
  const Bytes bytes = (Bytes)(code[0] | (code[1] << 8) | (code[2] << 16));
  const Bytes packed = __builtin_shuffle(
      bytes, Bytes{0,  1,  2,  4,  5,  6,  8,  9,  10, 12, 13, 14, 3,  7,  11, 15,
                   16, 17, 18, 20, 21, 22, 24, 25, 26, 28, 29, 30, 19, 23, 27, 31});
  std::memcpy(codes, &packed, 12),
      std::memcpy(codes + 12, reinterpret_cast<const std::uint8_t*>(&packed) + 16, 12);
}

CALIPSO_INLINE void encodeBody(const NoiseCurves& curves, const float* const (&colour)[5],
                               const NoiseRows& noise, int column, int count, cv::Vec3b* codes) {
  constexpr int kSide = NoiseField::kSide;
  int k = 0;
  for (; k + 8 <= count; k += 8, column = (column + 8) % kSide)
    encodeEight(curves, colour, k, noise, column, codes[k].val);
  if (k == count) return;
  cv::Vec3b rest[8];
  encodeEight(curves, colour, k, noise, column, rest[0].val);
  std::copy_n(rest, count - k, codes + k);
}

CALIPSO_INLINE void fillBody(const TriangleSpan* spans, const int* which, int count,
                             const SpanTarget& target) {
  if (target.ids != nullptr)
    fillSpansBody<true>(spans, which, count, target);
  else
    fillSpansBody<false>(spans, which, count, target);
}

#define CALIPSO_KERNELS(name, attribute)                                                          \
  attribute void name##Visible(const ShadowTexels& map, const ShadowTaps& taps,                   \
                               const LightPoints& points, int count, float* visible) {            \
    visibleBody(map, taps, points, count, visible);                                               \
  }                                                                                               \
  attribute unsigned name##Locate(const TriangleMap* maps, const std::uint32_t* ids,              \
                                  const PixelStretch& stretch, const SightLines& sight,           \
                                  SurfaceRun& run) {                                              \
    return locateBody(maps, ids, stretch, sight, run);                                            \
  }                                                                                               \
  attribute void name##Sample(const cv::Mat& image, int first, int last, SurfaceRun& run) {       \
    sampleBody(image, first, last, run);                                                          \
  }                                                                                               \
  attribute void name##Shade(const SurfaceShade& shade, int first, int last, SurfaceRun& run) {   \
    shadeBody(shade, first, last, run);                                                           \
  }                                                                                               \
  attribute void name##Encode(const NoiseCurves& curves, const float* const(&colour)[5],          \
                              const NoiseRows& noise, int column, int count, cv::Vec3b* codes) {  \
    encodeBody(curves, colour, noise, column, count, codes);                                      \
  }                                                                                               \
  attribute int name##MakeSpans(const ScreenMesh& mesh, int begin, int end, std::uint32_t object, \
                                const cv::Rect& region, TriangleSpan* out) {                      \
    return makeSpansBody(mesh, begin, end, object, region, out);                                  \
  }                                                                                               \
  attribute void name##Fill(const TriangleSpan* spans, const int* which, int count,               \
                            const SpanTarget& target) {                                           \
    fillBody(spans, which, count, target);                                                        \
  }                                                                                               \
  attribute void name##DrawSamples(const TriangleSamples& t, const SampledTile& tile,             \
                                   std::uint32_t id, EdgeCoverage::Pixel* pixels) {               \
    drawSamplesBody(t, tile, id, pixels);                                                         \
  }                                                                                               \
  const Kernels name##Table{name##Visible, name##Locate,    name##Sample, name##Shade,            \
                            name##Encode,  name##MakeSpans, name##Fill,   name##DrawSamples};

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
