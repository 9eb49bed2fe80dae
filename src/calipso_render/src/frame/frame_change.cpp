// The part of FrameCompositor that tells what an edit changes: light on the support planes, and
// what stays.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/frame_compositor.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/tiled_filter.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

// mask margins around a surface at rest in which the frame's pixels stay
constexpr int kRimReach = 4;

}  // namespace

// Where the original's shadow changes, it goes with its whole edge: a predicted shadow is off by
// some pixels, so what lies that near to both the shadow and the change is taken from the plate. A
// change of single pixels is noise of the shadow's border and moves nothing.
void FrameCompositor::findRelit() {
  relit_ = cv::Mat::zeros(region_.size(), CV_8U);
  const int reach = frame_.params.background.shadow_margin_px, side = reach + 2;
  const auto around = [side](const cv::Rect& r) {
    return r.empty() ? r
                     : cv::Rect(r.x - side, r.y - side, r.width + 2 * side, r.height + 2 * side);
  };
  const cv::Rect box = around(shadows_.shaded_box) & around(sun_changes_.box()) & region_;
  if (box.empty()) return;
  cv::Mat change(box.size(), CV_8U);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = box.y; v < box.br().y; ++v)
    findChange(v, box.x, box.br().x, change.ptr<std::uint8_t>(v - box.y));
  cv::Mat grown(box.size(), CV_8U);
  filterTiles(openedByThree(change), reach, grown, DiscDilation(reach));
  cv::min(grown, shadows_.shaded(box), grown);
  filterTiles(grown, 1, relit_(box - region_.tl()), [](const cv::Mat& from, cv::Mat& to) {
    cv::blur(from, to, {3, 3});
  });
}

// changeOfLight() at columns [from, to) of row v, where it is more than a pixel can follow.
void FrameCompositor::findChange(int v, int from, int to, std::uint8_t* out) const {
  std::memset(out, 0, to - from);
  const auto rowOf = [&](const cv::Mat& picture) {
    return picture.ptr<std::uint8_t>(v - region_.y) - region_.x;
  };
  const std::uint8_t *sun = rowOf(sun_now_), *sun_before = rowOf(sun_before_),
                     *sky = rowOf(sky_now_), *sky_before = rowOf(sky_before_),
                     *takes = rowOf(takes_light_);
  const float umbra = kPerLevel * luminance(frame_.prepared.umbra), lit = kPerLevel - umbra;
  sun_changes_.visitRow(v, from, to, [&](int begin, int end) {
    for (int u = begin; u < end; ++u) {
      const int more_sky = sky[u] - sky_before[u], more_sun = sun[u] - sun_before[u];
      const int beyond = more_sky - std::clamp<int>(more_sky, -kSoftSky, kSoftSky);
      if (takes[u] == 0 || (more_sun == 0 && beyond == 0)) continue;
      out[u - from] = changeOfLight(
          std::abs(umbra * static_cast<float>(beyond) + lit * static_cast<float>(more_sun)));
    }
  });
}

// Pixels of a box that lie nearer to what a surface has left than to where it rests: what no model
// has of the object there, such as a railing, went along. May be empty.
// @param own 255 = the surface is seen there
cv::Mat FrameCompositor::nearerToLeft(int surface, const cv::Mat& own, const cv::Mat& owner,
                                      const cv::Rect& box) const {
  if (frame_.prepared.outlines[surface].empty() || !frame_.at_key_camera) return {};
  const cv::Mat rests = own(box) & (still_(box) > 0.0f);
  cv::Mat left = frame_.prepared.outlines[surface](box + region_.tl()) & ~rests &
                 ((owner(box) < 0) | own(box));
  cv::morphologyEx(left, left, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));  // no mere silhouette
  if (cv::countNonZero(left) == 0) return {};
  cv::Mat to_left, to_rest;
  cv::distanceTransform(left == 0, to_left, cv::DIST_L1, cv::DIST_MASK_3, CV_8U);
  cv::distanceTransform(rests == 0, to_rest, cv::DIST_L1, cv::DIST_MASK_3, CV_8U);
  return to_left < to_rest;
}

// The rim of an original's pixels belongs to the surface beside it, not to another edited object's.
// @param owner CV_16SC1 over region_: edited surface that is seen there, -1 = none
void FrameCompositor::keepRims(const cv::Mat& owner) {
  cv::Mat rims = cv::Mat::zeros(region_.size(), CV_32F);
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (frame_.edited[i]) addRim(static_cast<int>(i), owner, rims);
  }
  rims.copyTo(still_, owner < 0);
}

void FrameCompositor::addRim(int surface, const cv::Mat& owner, cv::Mat& rims) const {
  const int margin = frame_.params.background.mask_margin_px, reach = kRimReach * margin;
  const cv::Rect whole({0, 0}, region_.size());
  const cv::Mat own = owner == surface;
  const cv::Rect seen = cv::boundingRect(own);
  if (seen.empty()) return;
  const auto around = [&](int px) {
    return cv::Rect(seen.x - px, seen.y - px, seen.width + 2 * px, seen.height + 2 * px) & whole;
  };
  const cv::Rect box = around(reach);
  cv::Mat rim = cv::Mat::zeros(box.size(), CV_32F), foreign = cv::Mat::zeros(whole.size(), CV_8U);
  still_(box).copyTo(rim, own(box));
  cv::dilate(rim, rim, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  for (std::size_t j = 0; j < frame_.edited.size(); ++j) {
    if (frame_.edited[j] && static_cast<int>(j) != surface)
      foreign |= originalOf(static_cast<int>(j));
  }
  const cv::Mat original = originalOf(surface);
  cv::Mat beside, near, inner;
  cv::dilate(foreign(box), beside, disc(margin));
  cv::dilate(original(box), near, disc(margin));
  cv::erode(original(box), inner, disc(margin));
  beside.setTo(0, near);
  // What the object has left shows it in the video, and is no rim.
  rim.setTo(0.0f, beside | inner);
  // Rims lie within 2 * reach px, along rows and columns, of what rests.
  const cv::Rect search = around(3 * reach);
  const cv::Mat gone = nearerToLeft(surface, own, owner, search);
  if (!gone.empty()) rim.setTo(0.0f, gone(box - search.tl()));
  cv::Mat here = rims(box);
  cv::max(here, rim, here);
}

// The triangles with a point that may be at rest.
bool FrameCompositor::findResting(int slot, std::vector<char>& can_rest) const {
  const Actor& actor = frame_.objects[slot].actor;
  can_rest.assign(actor.surface->triangles.size(), 0);
  if (!frame_.objects[slot].isAtRestInVideo()) return false;
  bool any = false;
#pragma omp parallel for schedule(static) reduction(|| : any)
  for (std::size_t t = 0; t < can_rest.size(); ++t) {
    can_rest[t] = mayMoveLess(actor.screen.points, frame_.objects[slot].observed.points,
                              actor.surface->triangles[t], kMovedPx);
    any = any || can_rest[t] != 0;
  }
  return any;
}

void FrameCompositor::findStill() {
  if (!frame_.params.keep_still) return;
  std::vector<std::vector<char>> can_rest(frame_.objects.size());
  bool any = false;
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot)
    any = findResting(static_cast<int>(slot), can_rest[slot]) || any;
  if (!any) return;
  still_ = cv::Mat::zeros(region_.size(), CV_32F);
  cv::Mat owner(region_.size(), CV_16S, cv::Scalar(-1));  // edited surface seen there
  cv::Mat repainted = cv::Mat::zeros(region_.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      const std::uint32_t id = centre_->ids(v)[u];
      if (id == VisibilityBuffer::kNothing || !frame_.objectOf(id).edited) continue;
      owner.at<short>(v, u) = static_cast<short>(frame_.objectOf(id).surface);
      if (can_rest[VisibilityBuffer::objectOf(id)][VisibilityBuffer::triangleOf(id)] == 0) continue;
      if (frame_.objectOf(id).look.changes()) repainted.at<std::uint8_t>(v, u) = 255;
      still_.at<float>(v, u) = frame_.stillness(id, u + region_.x, v + region_.y);
    }
  }
  keepRims(owner);
  cv::dilate(repainted, repainted, disc(kRepaintReach));
  still_.setTo(0.0f, repainted);
  if (!frame_.elsewhere.empty()) still_.setTo(0.0f, frame_.elsewhere(region_));
}

}  // namespace calipso::render
