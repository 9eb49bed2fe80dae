#include "frame/backdrop.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "calipso_render/colour.hpp"
#include "draw/eight_lanes.hpp"
#include "draw/wide_loops.hpp"
#include "frame/plane_light.hpp"

namespace calipso::render {
namespace {

// of a support plane's light before an edit: darker, its own pixels do not tell what it would be in
// more light
constexpr float kDarkest = 0.05f;
constexpr float kBrightest = 1.25f;  // times its light before, to which its own pixels still tell

// The light on pixels of a row: levels now and before, 255 where a change is taken at all, where
// the place comes to light, and how far the original's shadow is to be taken from the plate; and
// what of it no shade takes.
struct LightLevels {
  static constexpr int kKinds = 7;
  enum Kind { kSun, kSunBefore, kSky, kSkyBefore, kTakes, kRemoved, kRelit };
  const std::uint8_t* of[kKinds];
  const cv::Vec4b* umbra;
};

// What it makes of them.
struct LightFactors {
  static constexpr int kMost = 64;
  float from_plate[kMost];  // part that is taken from the plate
  // times the plate; times the frame's own pixel, which keeps its grain where it is darkened
  // further or sees a little more sky: what the sun newly reaches must come from the plate
  float now[3][kMost], change[3][kMost];
};

// Of eight pixels from the i-th on.
CALIPSO_INLINE void findEightFactors(const LightLevels& levels, int i, LightFactors& out) {
  const auto at = [&](LightLevels::Kind kind) { return eightLevels(levels.of[kind] + i); };
  const Eight sun = at(LightLevels::kSun), sun_before = at(LightLevels::kSunBefore),
              sky = at(LightLevels::kSky), sky_before = at(LightLevels::kSkyBefore),
              takes = at(LightLevels::kTakes), removed = at(LightLevels::kRemoved), one = all(1.0f);
  eightAt(out.from_plate + i) = removed > 0.0f ? one : at(LightLevels::kRelit) * kPerLevel;
  for (int c = 0; c < 3; ++c) {
    const Eight umbra = eightUmbras(levels.umbra + i, c) * (kPerLevel * kPerLevel),
                lit = kPerLevel - umbra;
    const Eight now = takes > 0.0f ? umbra * sky + lit * sun : one,
                before = umbra * sky_before + lit * sun_before;
    eightAt(out.now[c] + i) = now;
    eightAt(out.change[c] + i) = smaller(now / larger(before, all(kDarkest)), all(kBrightest));
  }
}

// @return whether anything is taken from the plate
CALIPSO_WIDE_LOOPS bool findLightFactors(const LightLevels& levels, int count, LightFactors& out) {
  int i = 0;
  for (; i + 8 <= count; i += 8) findEightFactors(levels, i, out);
  if (i < count) {
    std::uint8_t rest[LightLevels::kKinds][LightFactors::kMost] = {};
    cv::Vec4b umbra[LightFactors::kMost];
    LightLevels last{{}, umbra};
    std::copy(levels.umbra + i, levels.umbra + count, umbra + i);
    for (int k = 0; k < LightLevels::kKinds; ++k) {
      std::copy(levels.of[k] + i, levels.of[k] + count, rest[k] + i);
      last.of[k] = rest[k];
    }
    findEightFactors(last, i, out);
  }
  float most = 0.0f;
  for (int k = 0; k < count; ++k) most = std::max(most, out.from_plate[k]);
  return most > 0.0f;
}

// Linear colours of `count` pixels, by channels, from the frame's codes.
CALIPSO_WIDE_LOOPS void darken(const LightFactors& factors, const cv::Vec3b* frame, int count,
                               float* const (&out)[3]) {
  const float* decoded = decodeTable();
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < count; ++k) out[c][k] = decoded[frame[k][c]];
    for (int k = 0; k < count; ++k) out[c][k] *= factors.change[c][k];
  }
}

// The same from the plate, too.
CALIPSO_WIDE_LOOPS void relight(const LightFactors& factors, const cv::Vec3f* plate,
                                const cv::Vec3b* frame, int count, float* const (&out)[3]) {
  const float* decoded = decodeTable();
  float own[LightFactors::kMost], place[LightFactors::kMost];
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < count; ++k) own[k] = decoded[frame[k][c]], place[k] = plate[k][c];
    for (int k = 0; k < count; ++k) {
      const float from_plate = factors.from_plate[k];
      out[c][k] = from_plate * place[k] * factors.now[c][k] +
                  (1.0f - from_plate) * own[k] * factors.change[c][k];
    }
  }
}

// Asks for what the next row will read: its stretches lie below this one's.
void prefetchRow(const cv::Mat& picture, int v, int u, int count) {
  if (v >= picture.rows) return;
  const std::uint8_t* from = picture.ptr(v, u);
  for (std::size_t k = 0; k < count * picture.elemSize(); k += 64) __builtin_prefetch(from + k);
}

}  // namespace

Backdrop::Backdrop(const StagedFrame& frame, const SeenPlace& place, const RevealedPlace& revealed,
                   const Reflections& reflections, const ShadedOthers& others,
                   const DrawnSurfaces& surfaces, const EdgeCoverage& edges,
                   const PlaceLight& light, const cv::Mat& removed)
    : frame_(frame),
      place_(place),
      revealed_(revealed),
      reflections_(reflections),
      others_(others),
      surfaces_(surfaces),
      edges_(edges),
      light_(light),
      removed_(removed),
      region_(surfaces.centre().region()) {}

// The part of a pixel that objects which stay cover: of one on their outline less than all.
float Backdrop::coverOfOthers(int u, int v) const {
  const EdgeCoverage::Pixel* edge = edges_.at(u, v);
  if (edge == nullptr) return frame_.labels.at<std::uint8_t>(v, u) != 0 ? 1.0f : 0.0f;
  const auto stays = [&](std::uint32_t id) {
    return id != VisibilityBuffer::kNothing && !surfaces_.isDrawn(id, u, v);
  };
  return static_cast<float>(std::count_if(edge->ids.begin(), edge->ids.end(), stays)) /
         EdgeCoverage::kSamples;
}

Pixel Backdrop::at(int u, int v) const {
  const bool removed = removed_.at<std::uint8_t>(v - region_.y, u - region_.x) != 0;
  const float others = removed ? 0.0f : coverOfOthers(u, v);
  Pixel own{linearPixel(frame_.input.bgr, u, v), 0.0f, kOriginal};
  if (others > 0.0f && frame_.labels.at<std::uint8_t>(v, u) != 0)
    others_.shade(surfaces_.centre(), u, v, own);
  if (others == 1.0f) return own;
  const Pixel ground = groundAt(u, v, removed);
  if (others == 0.0f || ground.source == kOriginal) return others == 0.0f ? ground : own;
  return {others * own.colour + (1.0f - others) * ground.colour, (1.0f - others) * ground.fresh,
          ground.source};
}

// What a pixel shows where no object is.
Pixel Backdrop::groundAt(int u, int v, bool removed) const {
  Pixel behind = shadowedAt(u, v, removed);
  reflections_.add(u, v, behind);
  return behind;
}

// The same without what the planes mirror now.
Pixel Backdrop::shadowedAt(int u, int v, bool removed) const {
  Pixel behind{reflections_.takenOff(u, v), 0.0f, kOriginal};
  if (removed) behind = revealed_.at(u, v);
  const cv::Point at = cv::Point(u, v) - region_.tl();
  if (!light_.relightable().at(u, v) || light_.takes().at<std::uint8_t>(at) == 0) return behind;
  const int sun = light_.sun().at<std::uint8_t>(at),
            sun_before = light_.sunBefore().at<std::uint8_t>(at);
  const int sky = light_.sky().at<std::uint8_t>(at),
            sky_before = light_.skyBefore().at<std::uint8_t>(at);
  const cv::Vec4b& umbra = place_.umbra.at<cv::Vec4b>(v, u);
  cv::Vec3f now, before;
  for (int c = 0; c < 3; ++c)
    now[c] = shadowRatio(umbra[c], sun, sky),
    before[c] = shadowRatio(umbra[c], sun_before, sky_before);
  if (removed) {
    behind.colour = behind.colour.mul(now);
    return behind;
  }
  // Darkened further or seeing a little more sky, a pixel keeps its own grain; what the sun newly
  // reaches must come from the plate.
  const float from_plate = light_.relit().at<std::uint8_t>(at) / 255.0f;
  if (from_plate == 0.0f && std::abs(sun - sun_before) + std::abs(sky - sky_before) < kSameLevels)
    return behind;
  cv::Vec3f darkened = behind.colour;
  for (int c = 0; c < 3; ++c)
    darkened[c] *= std::min(kBrightest, now[c] / std::max(before[c], kDarkest));
  const Pixel revealed = revealed_.at(u, v);
  behind.colour = from_plate * revealed.colour.mul(now) + (1.0f - from_plate) * darkened;
  behind.fresh = from_plate * revealed.fresh;
  behind.source = from_plate > 0.5f ? revealed.source : kRendered;
  return behind;
}

// Pixels [first, last) of row v that nothing is drawn in: at().
void Backdrop::compose(int v, int first, int last, Row& row) const {
  const int j = v - region_.y;
  for (int i = first; i < last; i += LightFactors::kMost)
    composeRelit(v, i, std::min(last, i + LightFactors::kMost), row);
  if (reflections_.marks().empty() && place_.live == nullptr) return;
  const std::uint8_t *mirrored = reflections_.marks().empty()
                                     ? nullptr
                                     : reflections_.marks().ptr<std::uint8_t>(v) + region_.x,
                     *invented = place_.invented.ptr<std::uint8_t>(v) + region_.x,
                     *removed = removed_.ptr<std::uint8_t>(j),
                     *relit = light_.relit().ptr<std::uint8_t>(j);
  for (int i = first; i < last; ++i) {
    const bool filled_live =
        place_.live != nullptr && invented[i] != 0 && (removed[i] | relit[i]) != 0;
    if (!filled_live && (mirrored == nullptr || mirrored[i] == 0)) continue;
    const Pixel behind = groundAt(i + region_.x, v, removed[i] != 0);
    row.set(i, {behind.colour[0], behind.colour[1], behind.colour[2], behind.fresh});
    row.source[i] = behind.source;
  }
}

// The same of at most LightFactors::kMost pixels, from the plate as it was prepared and without
// what planes mirror.
void Backdrop::composeRelit(int v, int first, int last, Row& row) const {
  const int j = v - region_.y, count = last - first;
  const auto rowOf = [&](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j) + first; };
  const int u = first + region_.x;
  const cv::Vec3b* frame = frame_.input.bgr.ptr<cv::Vec3b>(v) + u;
  float* const colour[] = {&row.colour[0][first], &row.colour[1][first], &row.colour[2][first]};
  LightFactors factors;
  const bool wants_plate = findLightFactors(
      {{rowOf(light_.sun()), rowOf(light_.sunBefore()), rowOf(light_.sky()),
        rowOf(light_.skyBefore()), rowOf(light_.takes()), rowOf(removed_), rowOf(light_.relit())},
       place_.umbra.ptr<cv::Vec4b>(v) + u},
      count, factors);
  std::copy_n(factors.from_plate, count, &row.colour[3][first]);
  if (!wants_plate) {  // which is not even read then
    darken(factors, frame, count, colour);
    std::memset(&row.source[first], kRendered, count);
    return;
  }
  prefetchRow(place_.plate, v + 1, u, count);
  relight(factors, place_.plate.ptr<cv::Vec3f>(v) + u, frame, count, colour);
  const std::uint8_t* invented = place_.invented.ptr<std::uint8_t>(v) + u;
  for (int k = 0; k < count; ++k) {
    const Provenance revealed = invented[k] != 0 ? kInvented : kSeenElsewhere;
    row.source[first + k] = factors.from_plate[k] > 0.5f ? revealed : kRendered;
  }
}

}  // namespace calipso::render
