// The part of FrameCompositor that measures sun and sky on the support planes and the relief,
// before and after the edit.

#include <algorithm>
#include <cmath>
#include <cstring>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "draw/wide_loops.hpp"
#include "frame/frame_compositor.hpp"
#include "frame/marked.hpp"
#include "frame/plane_light.hpp"
#include "frame/plane_sky.hpp"

namespace calipso::render {
namespace {

// of the sky's light: differences of levels that come of no more are less than kSameLevels, or no
// more than kSoftSky, also once they are rounded
constexpr float kSameSky = (kSameLevels - 2.1f) * kPerLevel,
                kLittleSky = (kSoftSky - 2.1f) * kPerLevel;

CALIPSO_WIDE_LOOPS void markSeen(const std::uint32_t* ids, int count, std::uint8_t* seen) {
  for (int i = 0; i < count; ++i) seen[i] = ids[i] != VisibilityBuffer::kNothing ? 255 : 0;
}

// Product of two levels, 255 = 1.
std::uint8_t both(std::uint8_t a, std::uint8_t b) {
  const unsigned product = a * static_cast<unsigned>(b) + 128;
  return static_cast<std::uint8_t>((product + (product >> 8)) >> 8);
}

}  // namespace

// Edited objects hide only that part of the sky which others leave: the picture's pixels lack
// theirs already.
// @param sky of edited objects alone, columns [begin, end) of row v
void FrameCompositor::leaveHidden(int v, int begin, int end, std::uint8_t* sky) const {
  if (shadows_.others_sky.empty()) return;
  const float all_hidden = skyLight(0.0f), scale = kPerLevel / (1.0f - all_hidden),
              offset = all_hidden / (1.0f - all_hidden);
  const std::uint8_t* others = shadows_.others_sky.ptr<std::uint8_t>(v) + begin;
  for (int k = 0; k < end - begin; ++k) {
    const float left = std::clamp(scale * others[k] - offset, 0.0f, 1.0f);
    sky[k] = static_cast<std::uint8_t>(255.5f - left * static_cast<float>(255 - sky[k]));
  }
}

// @param shaded gets the squares that are not known to be all lit; may be null
cv::Mat FrameCompositor::sunOver(const Visibility& shadow, const cv::Rect& bounds,
                                 SquareMask* shaded) const {
  cv::Mat sun(frame_.input.bgr.size(), CV_8U, cv::Scalar(255)), part = sun(bounds);
  planesInLight(place_.view, shadow, bounds, SquareMask(), part, shaded);
  return sun;
}

// @param skip where it is not wanted
SkyGrid FrameCompositor::skyOver(const Visibility& shadow, const cv::Rect& region,
                                 const SquareMask& skip) const {
  return SkyGrid(place_.view.planes(), shadow, frame_.input.bgr.size(), region, skip);
}

// The whole picture's levels.
cv::Mat FrameCompositor::skyLevels(const SkyGrid& grid, const Visibility& shadow) const {
  cv::Mat sky(frame_.input.bgr.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < sky.rows; ++v)
    grid.levels(place_.view.planes(), shadow, v, 0, sky.cols, sky.ptr<std::uint8_t>(v));
  return sky;
}

void FrameCompositor::findCovered() {
  drawn_.create(region_.size(), CV_8U);
  all_drawn_ =
      std::all_of(always_drawn_.begin(), always_drawn_.end(), [](bool always) { return always; });
  const cv::Rect box = drawn_box_ - region_.tl();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    const std::uint32_t* ids = centre_->ids(v);
    std::uint8_t* drawn = drawn_.ptr<std::uint8_t>(v);
    std::memset(drawn, 0, region_.width);
    if (v < box.y || v >= box.br().y) continue;
    if (all_drawn_) {
      markSeen(ids + box.x, box.width, drawn + box.x);
    } else {
      for (int u = box.x; u < box.br().x; ++u)
        drawn[u] = isDrawn(ids[u], u + region_.x, v + region_.y) ? 255 : 0;
    }
  }
  if (!box.empty())
    covered_ = SquareMask(drawn_(box), drawn_box_, frame_.params.background.shadow_margin_px + 2);
}

// Sun and sky before the edit, and where light is taken at all; all of it stays while the same
// objects are edited.
void FrameCompositor::cacheBefore() {
  const cv::Size size = frame_.input.bgr.size();
  shadows_.sun_before.create(size, CV_8U), shadows_.takes.create(size, CV_8U);
  shadows_.sky_before = shadows_.originals_sky_levels.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < size.height; ++v) {
    joinBefore(v);
    leaveHidden(v, 0, size.width, shadows_.sky_before.ptr<std::uint8_t>(v));
    takeReliefInPlaneTerms(v, 0, size.width, shadows_.sun_before.ptr<std::uint8_t>(v),
                           shadows_.sky_before.ptr<std::uint8_t>(v));
  }
}

// Row v of what originals and others shade together, and of what takes shadows.
CALIPSO_WIDE_LOOPS void FrameCompositor::joinBefore(int v) {
  std::uint8_t *before = shadows_.sun_before.ptr<std::uint8_t>(v),
               *takes = shadows_.takes.ptr<std::uint8_t>(v);
  const auto rowOf = [v](const cv::Mat& picture) {
    return picture.empty() ? nullptr : picture.ptr<std::uint8_t>(v);
  };
  const std::uint8_t *others = rowOf(shadows_.others_sun),
                     *originals = rowOf(shadows_.originals_sun), *none = rowOf(place_.shadowless);
  const int width = shadows_.takes.cols;
  if (originals != nullptr)
    std::copy_n(originals, width, before);
  else
    std::fill_n(before, width, 255);
  for (int u = 0; others != nullptr && u < width; ++u) before[u] = both(before[u], others[u]);
  place_.view.seesRow(0, v, width, takes);
  for (int u = 0; none != nullptr && u < width; ++u) takes[u] = none[u] == 0 ? takes[u] : 0;
}

// Sun and sky now, in the squares in which they can matter: where they may differ from before,
// around where the sun may, and where the place behind an object comes to light.
void FrameCompositor::measureLight() {
  sun_before_ = shadows_.sun_before(region_), sky_before_ = shadows_.sky_before(region_);
  takes_light_ = shadows_.takes(region_);
  sun_now_ = cv::Mat(region_.size(), CV_8U, cv::Scalar(255));
  sky_now_.create(region_.size(), CV_8U);
  sun_changes_ = SquareMask(region_);
  const cv::Rect bounds = moved_bounds_ & region_;
  if (!bounds.empty()) {
    cv::Mat part = sun_now_(bounds - region_.tl());
    planesInLight(place_.view, *moved_shadow_, bounds, covered_, part, &sun_changes_);
  }
  sun_changes_.add(shadows_.sunless);
  const SkyGrid sky = skyOver(*moved_sky_, region_, covered_);
  SquareMask sky_changes(region_);
  findSkyChanges(sky, sky_changes);
  sun_changes_.remove(covered_);
  relightable_ = sun_changes_.grown(frame_.params.background.shadow_margin_px + 2);
  relightable_.add(sky_changes);
  relightable_.set(passing_.empty() ? shown_box_ : region_);
  relightable_.remove(covered_);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = region_.y; v < region_.br().y; ++v) {
    relightable_.visitRow(v, region_.x, region_.br().x,
                          [&](int begin, int end) { measureRun(sky, v, begin, end); });
  }
}

// Squares of the region in which the sky's light may differ from before.
void FrameCompositor::findSkyChanges(const SkyGrid& now, SquareMask& changes) {
  constexpr int kSide = SquareMask::kSide;
  const int first = region_.y / kSide, last = (region_.br().y - 1) / kSide;
#pragma omp parallel for schedule(static)
  for (int j = first; j <= last; ++j) {
    const cv::Rect row = cv::Rect(region_.x, j * kSide, region_.width, kSide) & region_;
    const std::vector<float> differences = now.differences(shadows_.originals_sky, row);
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
}

// Columns [begin, end) of row v.
void FrameCompositor::measureRun(const SkyGrid& sky_grid, int v, int begin, int end) {
  std::uint8_t *sun = sun_now_.ptr<std::uint8_t>(v - region_.y) + (begin - region_.x),
               *sky = sky_now_.ptr<std::uint8_t>(v - region_.y) + (begin - region_.x);
  sky_grid.levels(place_.view.planes(), *moved_sky_, v, begin, end, sky);
  leaveHidden(v, begin, end, sky);
  if (!shadows_.others_sun.empty()) {
    const std::uint8_t* others = shadows_.others_sun.ptr<std::uint8_t>(v) + begin;
    for (int k = 0; k < end - begin; ++k) sun[k] = both(sun[k], others[k]);
  }
  takeReliefInPlaneTerms(v, begin, end, sun, sky);
}

// The sun alone shades the relief; what its levels do to the support planes they do not do to it.
// @param sun, sky columns [begin, end) of row v
void FrameCompositor::takeReliefInPlaneTerms(int v, int begin, int end, std::uint8_t* sun,
                                             std::uint8_t* sky) const {
  const Relief& relief = place_.view.relief();
  if (relief.empty()) return;
  const float planes_umbra = luminance(frame_.prepared.umbra);
  const float* umbra = relief.umbra.ptr<float>(v) + begin;
  const std::uint8_t* seen = relief.seen.ptr<std::uint8_t>(v) + begin;
  const int count = end - begin;
  for (int k = nextMarked(seen, 0, count); k < count; k = nextMarked(seen, k + 1, count)) {
    const PlaneTerms terms = inPlaneTerms(kPerLevel * sun[k], umbra[k], planes_umbra);
    sun[k] = lightLevel(terms.sun), sky[k] = lightLevel(terms.sky);
  }
}

}  // namespace calipso::render
