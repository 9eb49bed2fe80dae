#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>

#include "calipso_render/visibility.hpp"
#include "draw/eight_lanes.hpp"
#include "frame/square_mask.hpp"
#include "place/place_view.hpp"
#include "place/relief_sky.hpp"

namespace calipso::render {

constexpr float kPerLevel = 1.0f / 255.0f;

// A visible part of a light, 0..1, as planes of a picture keep it.
inline std::uint8_t lightLevel(float visible) {
  return static_cast<std::uint8_t>(visible * 255.0f + 0.5f);
}

// The same of eight.
CALIPSO_INLINE EightBytes lightLevels(const Eight& visible) {
  return toBytes(__builtin_convertvector(visible * 255.0f + 0.5f, EightInts));
}

// Eight levels as numbers.
CALIPSO_INLINE Eight eightLevels(const std::uint8_t* at) {
  EightBytes levels;
  std::memcpy(&levels, at, sizeof(levels));
  return __builtin_convertvector(toInts(levels), Eight);
}

// Product of two levels, 255 = 1.
inline std::uint8_t bothLevels(std::uint8_t a, std::uint8_t b) {
  const unsigned product = a * static_cast<unsigned>(b) + 128;
  return static_cast<std::uint8_t>((product + (product >> 8)) >> 8);
}

// Part of its brightness that a place keeps when it sees these levels of sun and sky.
// @param umbra level: what the sun's absence leaves of it
inline float shadowRatio(int umbra, int sun, int sky) {
  return kPerLevel * kPerLevel * static_cast<float>(umbra * sky + (255 - umbra) * sun);
}

// A channel of eight pixels of Prepared::umbra, levels; the fourth is luminance.
CALIPSO_INLINE Eight eightUmbras(const cv::Vec4b* at, int channel) {
  EightInts umbras;
  std::memcpy(&umbras, at, sizeof(umbras));
  return __builtin_convertvector(umbras >> 8 * channel & 0xff, Eight);
}

// How much a change of brightness by `by` calls for the plate: 0 not visible .. 255 only it.
constexpr float kSameRatio = 0.01f,
                kPlateRatio = 0.06f;  // from which the plate is taken, and only it
inline std::uint8_t changeOfLight(float by) {
  const float t = std::clamp((by - kSameRatio) * (1.0f / (kPlateRatio - kSameRatio)), 0.0f, 1.0f);
  return static_cast<std::uint8_t>(static_cast<int>(255.0f * (t * t * (3.0f - 2.0f * t)) + 0.5f));
}

// The same of eight.
CALIPSO_INLINE EightBytes changesOfLight(const Eight& by) {
  const Eight t =
      smaller(larger((by - kSameRatio) * (1.0f / (kPlateRatio - kSameRatio)), Eight{}), all(1.0f));
  return lightLevels(t * t * (3.0f - 2.0f * t));
}

// Levels of the sky's light where relief is seen, instead of those of planes behind it.
// @param sky columns [begin, end) of row v
void takeReliefSky(const Relief& relief, const ReliefSky& on_walls, int v, int begin, int end,
                   std::uint8_t* sky);

// Takes the veil that haze lays over the place, which nothing shades, off what levels darken.
// @param veil CV_8UC1, whole picture; may be empty
// @param levels columns [begin, end) of row v
void veilLevels(const cv::Mat& veil, int v, int begin, int end, std::uint8_t* levels);

// What support planes and relief see of a light, pixel by pixel: exactly where it changes quickly,
// interpolated over two pixels where it changes slowly, and at once for squares that are all lit or
// all shaded.
// @param skip squares that are not wanted
// @param out CV_8UC1 over `rect`, lightLevel(); keeps its values where neither is seen, and where
// not wanted
// @param shaded gets the squares that are not known to be all lit; null: not wanted
void planesInLight(const PlaceView& view, const Visibility& light, const cv::Rect& rect,
                   const SquareMask& skip, cv::Mat& out, SquareMask* shaded = nullptr);

}  // namespace calipso::render
