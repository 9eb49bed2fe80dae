#include "frame/still_pixels.hpp"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/removed.hpp"

namespace calipso::render {
namespace {

// mask margins around a surface at rest in which the frame's pixels stay
constexpr int kRimReach = 4;

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
  // Rims lie within 2 * reach px, along rows and columns, of what rests.
  const cv::Rect search = around(3 * reach);
  const cv::Mat gone = nearerToLeft(surface, rests(search), owner, search);
  if (!gone.empty()) rim.setTo(0.0f, gone(box - search.tl()));
  cv::Mat here = rims(box);
  cv::max(here, rim, here);
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
