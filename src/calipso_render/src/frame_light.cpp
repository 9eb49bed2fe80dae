// The part of FrameCompositor that measures sun and sky on the support planes and the relief,
// before and after the edit.

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "frame_compositor.hpp"
#include "marked.hpp"
#include "plane_light.hpp"
#include "plane_sky.hpp"
#include "wide_loops.hpp"

namespace calipso::render {
namespace {

// Product of two levels, 255 = 1.
std::uint8_t both(std::uint8_t a, std::uint8_t b) {
  const unsigned product = a * static_cast<unsigned>(b) + 128;
  return static_cast<std::uint8_t>((product + (product >> 8)) >> 8);
}

}  // namespace

// Edited objects hide only that part of the sky which others leave: the picture's pixels lack
// theirs already.
// @param sky of edited objects alone, over `region`
void FrameCompositor::leaveHidden(cv::Mat& sky, const cv::Rect& region) const {
  if (shadows_.others_sky.empty()) return;
  const float all_hidden = skyLight(0.0f), scale = kPerLevel / (1.0f - all_hidden),
              offset = all_hidden / (1.0f - all_hidden);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region.height; ++v) {
    const std::uint8_t* others = shadows_.others_sky.ptr<std::uint8_t>(v + region.y) + region.x;
    std::uint8_t* row = sky.ptr<std::uint8_t>(v);
    for (int u = 0; u < region.width; ++u) {
      const float left = std::clamp(scale * others[u] - offset, 0.0f, 1.0f);
      row[u] = static_cast<std::uint8_t>(255.5f - left * static_cast<float>(255 - row[u]));
    }
  }
}

cv::Mat FrameCompositor::sunOver(const Visibility& shadow, const cv::Rect& bounds) const {
  cv::Mat sun(frame_.bgr.size(), CV_8U, cv::Scalar(255)), part = sun(bounds);
  planesInLight(place_view_, shadow, bounds, SquareMask(), part);
  return sun;
}

// @param skip where it is not wanted
cv::Mat FrameCompositor::skyOver(const Visibility& shadow, const cv::Rect& region,
                                 const SquareMask& skip) const {
  return planesUnderSky(place_view_.planes(), shadow, frame_.bgr.size(), region, skip);
}

void FrameCompositor::findCovered() {
  drawn_.create(region_.size(), CV_8U);
  all_drawn_ =
      std::all_of(always_drawn_.begin(), always_drawn_.end(), [](bool always) { return always; });
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    const std::uint32_t* ids = centre_->ids(v);
    std::uint8_t* drawn = drawn_.ptr<std::uint8_t>(v);
    if (all_drawn_) {
      for (int u = 0; u < region_.width; ++u)
        drawn[u] = ids[u] != VisibilityBuffer::kNothing ? 255 : 0;
    } else {
      for (int u = 0; u < region_.width; ++u)
        drawn[u] = isDrawn(ids[u], u + region_.x, v + region_.y) ? 255 : 0;
    }
  }
  covered_ = SquareMask(drawn_, region_, params_.background.shadow_margin_px + 2);
}

void FrameCompositor::measureSky() {
  sky_now_ = skyOver(*moved_sky_, region_, covered_);
  leaveHidden(sky_now_, region_);
  sky_before_ = shadows_.originals_sky(region_);
}

void FrameCompositor::measureSun() {
  sun_now_ = cv::Mat(region_.size(), CV_8U, cv::Scalar(255));
  sun_before_.create(region_.size(), CV_8U);
  takes_light_.create(region_.size(), CV_8U);
  const cv::Rect bounds = moved_bounds_ & region_;
  if (!bounds.empty()) {
    cv::Mat part = sun_now_(bounds - region_.tl());
    planesInLight(place_view_, *moved_shadow_, bounds, covered_, part);
  }
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) joinSun(v);
  takeReliefInPlaneTerms();
}

// The sun alone shades the relief; what its levels do to the support planes they do not do to it.
void FrameCompositor::takeReliefInPlaneTerms() {
  const Relief& relief = place_view_.relief();
  if (relief.empty()) return;
  sky_before_ = sky_before_.clone();  // it is the cache's
  const float planes_umbra = luminance(prepared_.umbra);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    std::uint8_t *sun_now = sun_now_.ptr<std::uint8_t>(v), *sky_now = sky_now_.ptr<std::uint8_t>(v);
    std::uint8_t *sun_before = sun_before_.ptr<std::uint8_t>(v),
                 *sky_before = sky_before_.ptr<std::uint8_t>(v);
    const float* umbra = relief.umbra.ptr<float>(v + region_.y) + region_.x;
    const std::uint8_t* seen = relief.seen.ptr<std::uint8_t>(v + region_.y) + region_.x;
    const auto take = [&](int u, std::uint8_t& sun, std::uint8_t& sky) {
      const PlaneTerms terms = inPlaneTerms(kPerLevel * sun, umbra[u], planes_umbra);
      sun = lightLevel(terms.sun), sky = lightLevel(terms.sky);
    };
    for (int u = nextMarked(seen, 0, region_.width); u < region_.width;
         u = nextMarked(seen, u + 1, region_.width)) {
      take(u, sun_now[u], sky_now[u]), take(u, sun_before[u], sky_before[u]);
    }
  }
}

// Row v of what edited objects and others shade together, and of what was shaded before.
CALIPSO_WIDE_LOOPS void FrameCompositor::joinSun(int v) {
  std::uint8_t *now = sun_now_.ptr<std::uint8_t>(v), *before = sun_before_.ptr<std::uint8_t>(v),
               *takes = takes_light_.ptr<std::uint8_t>(v);
  const auto rowOf = [&](const cv::Mat& picture) {
    return picture.empty() ? nullptr : picture.ptr<std::uint8_t>(v + region_.y) + region_.x;
  };
  const std::uint8_t *others = rowOf(shadows_.others_sun),
                     *originals = rowOf(shadows_.originals_sun), *none = rowOf(shadowless_);
  const int width = region_.width;
  if (originals != nullptr)
    std::copy_n(originals, width, before);
  else
    std::fill_n(before, width, 255);
  for (int u = 0; others != nullptr && u < width; ++u)
    now[u] = both(now[u], others[u]), before[u] = both(before[u], others[u]);
  place_view_.seesRow(region_.x, v + region_.y, width, takes);
  for (int u = 0; none != nullptr && u < width; ++u) takes[u] = none[u] == 0 ? takes[u] : 0;
  for (int u = 0; u < width;) {
    const int end = std::min(width, u + SquareMask::kSide - (region_.x + u) % SquareMask::kSide);
    if (covered_.at(region_.x + u, region_.y + v)) std::fill(takes + u, takes + end, 0);
    u = end;
  }
}

}  // namespace calipso::render
