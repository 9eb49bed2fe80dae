#include "frame/place_light.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "calipso_render/colour.hpp"
#include "draw/wide_loops.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/plane_light.hpp"
#include "frame/plane_sky.hpp"
#include "frame/tiled_filter.hpp"

namespace calipso::render {
namespace {

// levels of the sky, a fifth: so much more or less of it only brightens or darkens a pixel
constexpr float kSoftSky = 51.0f;
constexpr int kFullShade = 15;  // level of the sun
// of the sky's light: differences of levels that come of no more are less than kSameLevels, or no
// more than kSoftSky, also once they are rounded
constexpr float kSameSky = (kSameLevels - 2.1f) * kPerLevel,
                kLittleSky = (kSoftSky - 2.1f) * kPerLevel;

// The light on pixels of a row, levels, and where it is taken at all.
struct LightChange {
  const std::uint8_t *sun, *sun_before, *sky, *sky_before, *takes;
  const cv::Vec4b* umbra;
};

// changesOfLight() of eight pixels from the i-th on, where it is more than a pixel can follow.
CALIPSO_INLINE EightBytes eightChanges(const LightChange& at, int i) {
  const Eight umbra = eightUmbras(at.umbra + i, 3) * (kPerLevel * kPerLevel),
              more_sky = eightLevels(at.sky + i) - eightLevels(at.sky_before + i),
              more_sun = eightLevels(at.sun + i) - eightLevels(at.sun_before + i),
              soft = smaller(larger(more_sky, all(-kSoftSky)), all(kSoftSky)),
              by = umbra * (more_sky - soft) + (kPerLevel - umbra) * more_sun;
  return changesOfLight(eightLevels(at.takes + i) > 0.0f ? larger(by, -by) : Eight{});
}

// The same of `count` pixels.
CALIPSO_WIDE_LOOPS void findChanges(const LightChange& at, int count, std::uint8_t* out) {
  for (int i = 0; i + 8 <= count; i += 8) {
    const EightBytes changes = eightChanges(at, i);
    std::memcpy(out + i, &changes, 8);
  }
  const int done = count / 8 * 8, more = count - done;
  if (more == 0) return;
  std::uint8_t rest[5][8] = {};
  const std::uint8_t* const from[] = {at.sun, at.sun_before, at.sky, at.sky_before, at.takes};
  for (int k = 0; k < 5; ++k) std::copy_n(from[k] + done, more, rest[k]);
  cv::Vec4b umbra[8];
  std::copy_n(at.umbra + done, more, umbra);
  const EightBytes changes = eightChanges({rest[0], rest[1], rest[2], rest[3], rest[4], umbra}, 0);
  std::memcpy(out + done, &changes, more);
}

// @param sun level now @param near_light != 0: not deep in a shadow before
CALIPSO_WIDE_LOOPS void keepShade(const std::uint8_t* sun, const std::uint8_t* near_light,
                                  int count, std::uint8_t* relit) {
  for (int u = 0; u < count; ++u) {
    const int most = near_light[u] != 0 ? 255 : std::min(255, sun[u] * (255 / kFullShade));
    relit[u] = static_cast<std::uint8_t>(std::min<int>(relit[u], most));
  }
}

}  // namespace

PlaceLight::PlaceLight(const StagedFrame& frame, const SeenPlace& place,
                       const RestingLight& resting, const MovedShadow& moved,
                       const EditedRegion& region, const SquareMask& covered)
    : frame_(frame),
      place_(place),
      resting_(resting),
      moved_(moved),
      region_(region.all),
      sun_(region_.size(), CV_8U, cv::Scalar(255)),
      sky_(region_.size(), CV_8U),
      sun_before_(resting.sunBefore()(region_)),
      sky_before_(resting.skyBefore()(region_)),
      takes_(resting.takes()(region_)),
      sun_changes_(region_) {
  measure(region.revealed, covered);
  findRelit();
}

void PlaceLight::measure(const cv::Rect& revealed, const SquareMask& covered) {
  const cv::Rect bounds = moved_.bounds & region_;
  if (!bounds.empty()) {
    cv::Mat part = sun_(bounds - region_.tl());
    planesInLight(place_.view, *moved_.sun, bounds, covered, part, &sun_changes_);
  }
  sun_changes_.add(resting_.sunless());
  const SkyGrid sky(place_.view.planes(), *moved_.sky, frame_.input.bgr.size(), region_, covered);
  std::optional<SkyGrid> observed;
  if (moved_.sky_before)
    observed.emplace(place_.view.planes(), *moved_.sky_before, frame_.input.bgr.size(), region_,
                     covered);
  const SkyGrid& before = observed ? *observed : resting_.originalsSky();
  SquareMask sky_changes(region_);
  findSkyChanges(sky, before, sky_changes);
  sun_changes_.remove(covered);
  relightable_ = sun_changes_.grown(frame_.params.background.shadow_margin_px + 2);
  relightable_.add(sky_changes);
  relightable_.set(revealed);
  relightable_.remove(covered);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = region_.y; v < region_.br().y; ++v) {
    relightable_.visitRow(v, region_.x, region_.br().x,
                          [&](int begin, int end) { measureRun(sky, v, begin, end); });
  }
  if (observed) takeObservedSky(*observed);
}

// On support planes the sky before the edit is what this grid says, no less than it is now: where
// an object that moves is always near, the plate has been in its shade, too.
void PlaceLight::takeObservedSky(const SkyGrid& observed) {
  sky_before_ = sky_before_.clone();
  const Relief& relief = place_.view.relief();
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = region_.y; v < region_.br().y; ++v) {
    relightable_.visitRow(v, region_.x, region_.br().x, [&](int begin, int end) {
      std::vector<std::uint8_t> levels(end - begin);
      observed.levels(place_.view.planes(), *moved_.sky_before, v, begin, end, levels.data());
      resting_.leaveHidden(v, begin, end, levels.data());
      veilLevels(place_.veil, v, begin, end, levels.data());
      std::uint8_t* sky = sky_before_.ptr<std::uint8_t>(v - region_.y) + (begin - region_.x);
      const std::uint8_t* now = sky_.ptr<std::uint8_t>(v - region_.y) + (begin - region_.x);
      for (int k = 0; k < end - begin; ++k)
        sky[k] = relief.at(begin + k, v) ? sky[k] : std::max(levels[k], now[k]);
    });
  }
}

// Squares of the region in which the sky's light may differ from before.
void PlaceLight::findSkyChanges(const SkyGrid& now, const SkyGrid& before, SquareMask& changes) {
  constexpr int kSide = SquareMask::kSide;
  const int first = region_.y / kSide, last = (region_.br().y - 1) / kSide;
#pragma omp parallel for schedule(static)
  for (int j = first; j <= last; ++j) {
    const cv::Rect row = cv::Rect(region_.x, j * kSide, region_.width, kSide) & region_;
    const std::vector<float> differences = now.differences(before, row);
    const auto at = [&](int u) {
      return differences.begin() + (u / now.step() - row.x / now.step());
    };
    for (int u = region_.x / kSide * kSide; u < region_.br().x; u += kSide) {
      const cv::Rect square = cv::Rect(u, row.y, kSide, row.height) & region_;
      const float difference = *std::max_element(at(square.x), at(square.br().x - 1) + 1);
      if (difference > kSameSky) changes.set(square);
      if (difference > kLittleSky) sun_changes_.set(square);
    }
  }
  if (!moved_.on_walls.empty() || resting_.shadesWalls()) findWallChanges(changes);
}

// The same on walls.
void PlaceLight::findWallChanges(SquareMask& changes) {
  constexpr int kSide = SquareMask::kSide;
  const Relief& relief = place_.view.relief();
  const int first = region_.y / kSide, last = (region_.br().y - 1) / kSide;
#pragma omp parallel for schedule(dynamic, 2)
  for (int j = first; j <= last; ++j) {
    for (int u = region_.x / kSide * kSide; u < region_.br().x; u += kSide) {
      if (!relief.touches(u, j * kSide, kSide)) continue;
      const cv::Rect square = cv::Rect(u, j * kSide, kSide, kSide) & region_;
      float difference = 0.0f;
      for (int v = square.y; v < square.br().y; ++v) {
        const std::uint8_t* before = resting_.originalsSkyLevels().ptr<std::uint8_t>(v);
        std::uint8_t now[kSide];
        std::copy_n(before + square.x, square.width, now);
        takeReliefSky(relief, moved_.on_walls, v, square.x, square.br().x, now);
        for (int k = 0; k < square.width; ++k)
          difference = std::max(difference, kPerLevel * std::abs(now[k] - before[square.x + k]));
      }
      if (difference > kSameSky) changes.set(square);
      if (difference > kLittleSky) sun_changes_.set(square);
    }
  }
}

// Columns [begin, end) of row v.
void PlaceLight::measureRun(const SkyGrid& sky_grid, int v, int begin, int end) {
  std::uint8_t *sun = sun_.ptr<std::uint8_t>(v - region_.y) + (begin - region_.x),
               *sky = sky_.ptr<std::uint8_t>(v - region_.y) + (begin - region_.x);
  sky_grid.levels(place_.view.planes(), *moved_.sky, v, begin, end, sky);
  takeReliefSky(place_.view.relief(), moved_.on_walls, v, begin, end, sky);
  resting_.leaveHidden(v, begin, end, sky);
  resting_.addOthersSun(v, begin, end, sun);
  veilLevels(place_.veil, v, begin, end, sun), veilLevels(place_.veil, v, begin, end, sky);
}

// Where the original's shadow changes, it goes with its whole edge: a predicted shadow is off by
// some pixels, so what lies that near to both the shadow and the change is taken from the plate. A
// change of single pixels is noise of the shadow's border and moves nothing.
void PlaceLight::findRelit() {
  relit_ = cv::Mat::zeros(region_.size(), CV_8U);
  const int reach = frame_.params.background.shadow_margin_px, side = reach + 2;
  const cv::Rect box =
      grown(resting_.shadedBox(), side) & grown(sun_changes_.box(), side) & region_;
  if (box.empty()) return;
  cv::Mat change(box.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = box.y; v < box.br().y; ++v)
    findChange(v, box.x, box.br().x, change.ptr<std::uint8_t>(v - box.y));
  cv::Mat wide(box.size(), CV_8U);
  filterTiles(openedByThree(change), reach, wide, DiscDilation(reach));
  cv::min(wide, resting_.shaded()(box), wide);
  leaveDeepShade(box, reach, wide);
  filterTiles(wide, 1, relit_(box - region_.tl()), [](const cv::Mat& from, cv::Mat& to) {
    cv::blur(from, to, {3, 3});
  });
}

// What was deep in a shadow and still is keeps its own pixels: they tell how dark it is there.
// @param box of the picture @param relit over it
void PlaceLight::leaveDeepShade(const cv::Rect& box, int reach, cv::Mat& relit) const {
  const cv::Rect here = box - region_.tl();
  const cv::Mat in_light = sun_before_(here) > kFullShade;
  cv::Mat near_light(box.size(), CV_8U);
  filterTiles(in_light, reach, near_light, DiscDilation(reach));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v)
    keepShade(sun_.ptr(here.y + v) + here.x, near_light.ptr(v), box.width, relit.ptr(v));
}

// changeOfLight() at columns [from, to) of row v, where it is more than a pixel can follow.
void PlaceLight::findChange(int v, int from, int to, std::uint8_t* out) const {
  std::memset(out, 0, to - from);
  const auto rowOf = [&](const cv::Mat& picture) {
    return picture.ptr<std::uint8_t>(v - region_.y) - region_.x;
  };
  const std::uint8_t *sun = rowOf(sun_), *sun_before = rowOf(sun_before_), *sky = rowOf(sky_),
                     *sky_before = rowOf(sky_before_), *takes = rowOf(takes_);
  const cv::Vec4b* umbra = place_.umbra.ptr<cv::Vec4b>(v);
  sun_changes_.visitRow(v, from, to, [&](int begin, int end) {
    findChanges({sun + begin, sun_before + begin, sky + begin, sky_before + begin, takes + begin,
                 umbra + begin},
                end - begin, out + begin - from);
  });
}

}  // namespace calipso::render
