#include "frame/still_pixels.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/removed.hpp"
#include "smooth_step.hpp"

namespace calipso::render {
namespace {

// mask margins around a surface at rest in which the frame's pixels stay
constexpr int kRimReach = 4;
// of the visible sun: changes on a surface at rest that are not seen, and from which it is drawn
constexpr float kSameSun = 0.05f, kOtherSun = 0.2f;

// Is the light on the place another one at (i, j) of the region?
bool isRelitAt(const PlaceLight& light, const cv::Rect& region, int i, int j) {
  if (light.takes().at<std::uint8_t>(j, i) == 0 ||
      !light.relightable().at(i + region.x, j + region.y))
    return false;
  const auto change = [&](const cv::Mat& now, const cv::Mat& before) {
    return std::abs(now.at<std::uint8_t>(j, i) - before.at<std::uint8_t>(j, i));
  };
  return change(light.sun(), light.sunBefore()) + change(light.sky(), light.skyBefore()) >=
         kSameLevels;
}

struct SunOnSurfaces {
  const StagedFrame& frame;
  const MovedShadow& moved;
  const RestingLight& resting;

  // How far a pixel's surface has the sun that it has in the video: 0 where edited objects keep it
  // off, or let it in.
  float sameAt(std::uint32_t id, int u, int v) const {
    const SurfacePoint p = surfacePoint(frame.objectOf(id).actor, VisibilityBuffer::triangleOf(id),
                                        static_cast<float>(u), static_cast<float>(v), frame.eye);
    if (p.normal.dot(frame.light.direction) <= 0.0f) return 1.0f;
    const Visibility* originals = resting.originals();
    const float now = moved.sun->visibility(p.position, p.normal),
                before = originals != nullptr ? originals->visibility(p.position, p.normal) : 1.0f;
    return 1.0f - smoothStep(kSameSun, kOtherSun, std::abs(now - before));
  }
};

cv::v_float32x4 linearOf(const float* decoded, const cv::Vec3b& c) {
  return {decoded[c[0]], decoded[c[1]], decoded[c[2]], 0.0f};
}

}  // namespace

StillPixels::StillPixels(const StagedFrame& frame, const SeenPlace& place,
                         const VisibilityBuffer& centre, const cv::Mat& removed)
    : frame_(frame), place_(place), centre_(centre), removed_(removed), region_(centre.region()) {
  if (!frame.params.keep_still) return;
  std::vector<std::vector<char>> can_rest;  // per slot and triangle
  bool any = false;
  for (const StagedObject& object : frame.objects) {
    can_rest.emplace_back();
    any = findResting(object, can_rest.back()) || any;
  }
  if (!any) return;
  Seen seen = findParts(can_rest);
  // What the video shows of objects that have left is no picture of what they hid.
  parts_.setTo(0.0f, shownOfMoved(frame, seen.owner, region_) & (seen.owner >= 0));
  keepRims(seen.owner);
  cv::dilate(seen.repainted, seen.repainted, disc(kRepaintReach));
  parts_.setTo(0.0f, seen.repainted);
  if (!frame.elsewhere.empty()) parts_.setTo(0.0f, frame.elsewhere(region_));
}

StillPixels::Seen StillPixels::findParts(const std::vector<std::vector<char>>& can_rest) {
  parts_ = cv::Mat::zeros(region_.size(), CV_32F);
  Seen seen{cv::Mat(region_.size(), CV_16S, cv::Scalar(-1)), cv::Mat::zeros(region_.size(), CV_8U)};
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      const std::uint32_t id = centre_.ids(v)[u];
      if (id == VisibilityBuffer::kNothing || !frame_.objectOf(id).edited) continue;
      seen.owner.at<short>(v, u) = static_cast<short>(frame_.objectOf(id).surface);
      if (can_rest[VisibilityBuffer::objectOf(id)][VisibilityBuffer::triangleOf(id)] == 0) continue;
      if (frame_.objectOf(id).look.changes()) seen.repainted.at<std::uint8_t>(v, u) = 255;
      parts_.at<float>(v, u) = frame_.stillness(id, u + region_.x, v + region_.y);
    }
  }
  return seen;
}

// The rim of an original's pixels belongs to the surface beside it, not to another edited object's.
// @param owner CV_16SC1 over region_: edited surface that is seen there, -1 = none
void StillPixels::keepRims(const cv::Mat& owner) {
  cv::Mat rims = cv::Mat::zeros(region_.size(), CV_32F);
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (frame_.edited[i]) addRim(static_cast<int>(i), owner, rims);
  }
  rims.copyTo(parts_, owner < 0);
}

void StillPixels::addRim(int surface, const cv::Mat& owner, cv::Mat& rims) const {
  const int margin = frame_.params.background.mask_margin_px, reach = kRimReach * margin;
  const cv::Rect whole({0, 0}, region_.size());
  const cv::Mat rests = (owner == surface) & (parts_ > 0.0f);
  const cv::Rect seen = cv::boundingRect(rests);
  if (seen.empty()) return;
  const auto around = [&](int px) { return grown(seen, px) & whole; };
  const cv::Rect box = around(reach), wide = around(reach + margin);
  cv::Mat rim = cv::Mat::zeros(box.size(), CV_32F);
  parts_(box).copyTo(rim, rests(box));
  cv::dilate(rim, rim, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  const cv::Mat original = shownOf(frame_, place_, surface, wide + region_.tl())(box - wide.tl());
  cv::Mat beside, near, inner;
  cv::dilate(shownOfOthers(surface, wide)(box - wide.tl()), beside, disc(margin));
  cv::dilate(original, near, disc(margin));
  cv::erode(original, inner, disc(margin));
  beside.setTo(0, near);
  // What the object has left shows it in the video, and is no rim.
  rim.setTo(0.0f, beside | inner);
  const cv::Mat own(box.size(), CV_16S, cv::Scalar(surface));
  rim.setTo(0.0f, shownOfMoved(frame_, own, box + region_.tl()));
  keepLines(surface, owner, rims);
  // Rims lie within 2 * reach px, along rows and columns, of what rests.
  const cv::Rect search = around(3 * reach);
  const cv::Mat gone = nearerToLeft(surface, rests(search), owner, search);
  if (!gone.empty()) rim.setTo(0.0f, gone(box - search.tl()));
  cv::Mat here = rims(box);
  cv::max(here, rim, here);
}

// What the object's mask shows and no model has, however far from that, such as the ends of guy
// lines, as long as nothing of it has left.
void StillPixels::keepLines(int surface, const cv::Mat& owner, cv::Mat& rims) const {
  if (frame_.moved[surface]) return;
  cv::Mat lines =
      (frame_.labels(region_) == frame_.prepared.surfaces[surface].index) & (owner != surface);
  if (cv::countNonZero(lines) == 0) return;
  cv::dilate(lines, lines, disc(2 * frame_.params.background.mask_margin_px));
  lines.setTo(0, shownOfOthers(surface, {{0, 0}, region_.size()}));
  const cv::Mat own(region_.size(), CV_16S, cv::Scalar(surface));
  lines.setTo(0, shownOfMoved(frame_, own, region_));
  rims.setTo(1.0f, lines & (owner < 0));
}

// Pixels of a box that lie nearer to what a surface has left than to where it rests: what no model
// has of the object there, such as a railing, went along. May be empty.
// @param rests 255 = the surface is seen there, and rests
cv::Mat StillPixels::nearerToLeft(int surface, const cv::Mat& rests, const cv::Mat& owner,
                                  const cv::Rect& box) const {
  if (frame_.prepared.outlines[surface].empty() || !frame_.at_key_camera) return {};
  cv::Mat left = frame_.prepared.outlines[surface](box + region_.tl()) & ~rests &
                 ((owner(box) < 0) | (owner(box) == surface));
  cv::morphologyEx(left, left, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));  // no mere silhouette
  if (cv::countNonZero(left) == 0) return {};
  cv::Mat to_left, to_rest;
  cv::distanceTransform(left == 0, to_left, cv::DIST_L1, cv::DIST_MASK_3, CV_8U);
  cv::distanceTransform(rests == 0, to_rest, cv::DIST_L1, cv::DIST_MASK_3, CV_8U);
  return to_left < to_rest;
}

void StillPixels::leaveRelit(const PlaceLight& light, const MovedShadow& moved,
                             const RestingLight& resting, cv::Mat& removed) {
  const bool other_sun = frame_.input.sun.changes(), own_shadows = frame_.movesInVideo();
  const auto count = std::count(frame_.moved.begin(), frame_.moved.end(), true);
  if (none() || (count == 0 && !other_sun)) return;
  const SunOnSurfaces sun{frame_, moved, resting};
  relit_ = cv::Mat::zeros(region_.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 8)
  for (int j = 0; j < region_.height; ++j) {
    const std::uint32_t* ids = centre_.ids(j);
    float* parts = parts_.ptr<float>(j);
    for (int i = 0; i < region_.width; ++i) {
      if (parts[i] == 0.0f) continue;
      if (ids[i] == VisibilityBuffer::kNothing || !frame_.objectOf(ids[i]).edited) {
        if (!isRelitAt(light, region_, i, j)) continue;
        parts[i] = 0.0f, relit_.at<std::uint8_t>(j, i) = 255;
        if (!own_shadows) removed.at<std::uint8_t>(j, i) = 0;
      } else if (other_sun) {
        parts[i] = 0.0f;
      } else if (count > (frame_.moved[frame_.objectOf(ids[i]).surface] ? 1 : 0)) {
        parts[i] *= sun.sameAt(ids[i], i + region_.x, j + region_.y);
      }
    }
  }
}

// The triangles with a point that may be at rest.
bool StillPixels::findResting(const StagedObject& object, std::vector<char>& can_rest) const {
  const Actor& actor = object.actor;
  can_rest.assign(actor.surface->triangles.size(), 0);
  if (!object.isAtRestInVideo()) return false;
  bool any = false;
#pragma omp parallel for schedule(static) reduction(|| : any)
  for (std::size_t t = 0; t < can_rest.size(); ++t) {
    can_rest[t] = mayMoveLess(actor.screen.points, object.observed.points,
                              actor.surface->triangles[t], kMovedPx);
    any = any || can_rest[t] != 0;
  }
  return any;
}

// What the video shows of all other edited objects. CV_8UC1 over a box of the region
cv::Mat StillPixels::shownOfOthers(int surface, const cv::Rect& box) const {
  cv::Mat shown = cv::Mat::zeros(box.size(), CV_8U);
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (frame_.edited[i] && static_cast<int>(i) != surface)
      shown |= shownOf(frame_, place_, static_cast<int>(i), box + region_.tl());
  }
  return shown;
}

void StillPixels::keep(int v, Row& row) const {
  if (parts_.empty()) return;
  const int j = v - region_.y;
  const std::uint8_t* removed = removed_.ptr<std::uint8_t>(j);
  const float* still = parts_.ptr<float>(j);
  const cv::Vec3b* frame = frame_.input.bgr.ptr<cv::Vec3b>(v) + region_.x;
  for (int i = 0; i < region_.width; ++i) {
    if (still[i] == 0.0f || row.source[i] == kOriginal ||
        (removed[i] == 0 && row.source[i] != kRendered))
      continue;
    if (still[i] >= kKept) {
      row.source[i] = kOriginal;
      continue;
    }
    cv::Vec4f mixed;
    cv::v_store(mixed.val, cv::v_setall_f32(still[i]) * linearOf(decodeTable(), frame[i]) +
                               cv::v_setall_f32(1.0f - still[i]) * cv::v_load(row.at(i).val));
    row.set(i, mixed);
  }
}

}  // namespace calipso::render
