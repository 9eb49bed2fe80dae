#include "frame/removed.hpp"

#include <cstring>
#include <opencv2/imgproc.hpp>

#include "draw/wide_loops.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/reflections.hpp"
#include "frame/tiled_filter.hpp"

namespace calipso::render {
namespace {

constexpr int kInFront = 127;  // of a matte

// Row v of the pixels of a box that show an edited object in the video, and of those that show
// another one.
CALIPSO_WIDE_LOOPS void findShown(const StagedFrame& frame, const SeenPlace& place, int v,
                                  const cv::Rect& box, std::uint8_t* own, std::uint8_t* others) {
  const int width = box.width;
  const std::uint8_t* labels = frame.labels.ptr<std::uint8_t>(v) + box.x;
  for (int u = 0; u < width; ++u) own[u] = 0, others[u] = labels[u] != 0 ? 255 : 0;
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    if (!frame.edited[i] || !frame.prepared.surfaces[i].in_video) continue;
    const std::uint8_t index = static_cast<std::uint8_t>(frame.prepared.surfaces[i].index);
    for (int u = 0; u < width; ++u)
      own[u] |= labels[u] == index ? 255 : 0, others[u] &= labels[u] == index ? 0 : 255;
    if (place.footprints[i].empty()) continue;
    const std::uint8_t* footprint = place.footprints[i].ptr<std::uint8_t>(v) + box.x;
    for (int u = 0; u < width; ++u) own[u] |= footprint[u];
  }
}

bool areSame(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size()) return false;
  for (int v = 0; v < a.rows; ++v) {
    if (std::memcmp(a.ptr(v), b.ptr(v), a.cols) != 0) return false;
  }
  return true;
}

}  // namespace

void ShownPixels::update(const StagedFrame& frame, const SeenPlace& place, const cv::Rect& box) {
  // From elsewhere the key frame's footprints are seen in other places.
  if (at_key_camera_ && frame.at_key_camera && box_ == box && edited_ == frame.edited &&
      areSame(labels_, frame.labels(box)))
    return;
  box_ = box, edited_ = frame.edited, at_key_camera_ = frame.at_key_camera;
  labels_ = frame.labels(box).clone();
  own_.create(box.size(), CV_8U), others_.create(box.size(), CV_8U);
  cv::Mat without_margin(box.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v)
    findShown(frame, place, v + box.y, box, without_margin.ptr<std::uint8_t>(v),
              others_.ptr<std::uint8_t>(v));
  const int margin = frame.params.background.mask_margin_px;
  filterTiles(without_margin, margin, own_, DiscDilation(margin));
  cv::erode(others_, others_, disc(kMixed));
}

namespace {

// What a box's pixels show of edited objects, with a margin, and of their passing shadows, but not
// what stands clear of them.
// @param out CV_8UC1 of the box's size
void findRemoved(const ShownPixels& shown, const cv::Mat& passing, const cv::Rect& box,
                 cv::Mat out) {
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    std::uint8_t* row = out.ptr<std::uint8_t>(v);
    const std::uint8_t *own = shown.own().ptr<std::uint8_t>(v),
                       *stays = shown.others().ptr<std::uint8_t>(v),
                       *passes =
                           passing.empty() ? own : passing.ptr<std::uint8_t>(v + box.y) + box.x;
    for (int u = 0; u < box.width; ++u)
      row[u] = (own[u] | passes[u]) & static_cast<std::uint8_t>(~stays[u]);
  }
}

}  // namespace

cv::Mat removedPixels(const StagedFrame& frame, const SeenPlace& place, const EditedRegion& region,
                      const cv::Mat& passing, const cv::Mat& mirrored, ShownPixels& shown) {
  cv::Mat removed = cv::Mat::zeros(region.all.size(), CV_8U);
  const cv::Rect& box = region.revealed;
  if (!box.empty()) {
    shown.update(frame, place, box);
    findRemoved(shown, passing, box, removed(box - region.all.tl()));
  }
  cv::Mat passing_before;
  for (const cv::Mat& front : place.fronts) {
    if (front.empty()) continue;
    if (passing_before.empty())
      passing_before = shownInPassing(frame, region.all, frame.params.background.mask_margin_px);
    removed.setTo(0, front(region.all) & ~passing_before);
  }
  const cv::Mat& lost = frame.prepared.mirror.lost;
  if (!mirrored.empty() && !lost.empty())
    removed |= lost(region.all) & (mirrored(region.all) == Reflections::kChanged) &
               (frame.labels(region.all) == 0);
  if (!frame.params.matte.empty() && frame.at_key_camera)
    removed.setTo(0, frame.params.matte(region.all) > kInFront);
  return removed;
}

cv::Mat shownOf(const StagedFrame& frame, const SeenPlace& place, int surface,
                const cv::Rect& box) {
  cv::Mat shown = frame.labels(box) == frame.prepared.surfaces[surface].index;
  if (!place.footprints[surface].empty()) shown |= place.footprints[surface](box);
  return shown;
}

cv::Mat shownInPassing(const StagedFrame& frame, const cv::Rect& box, int margin) {
  cv::Mat shown = cv::Mat::zeros(box.size(), CV_8U);
  for (std::size_t i = 0; i < frame.at_rest.size(); ++i) {
    if (!frame.at_rest[i]) shown |= frame.labels(box) == frame.prepared.surfaces[i].index;
  }
  if (cv::countNonZero(shown) > 0) cv::dilate(shown, shown, disc(margin));
  return shown;
}

cv::Mat shownOfMoved(const StagedFrame& frame, const cv::Mat& owners, const cv::Rect& box) {
  cv::Mat shown = cv::Mat::zeros(box.size(), CV_8U), of_one;
  for (std::size_t i = 0; i < frame.moved.size(); ++i) {
    if (!frame.moved[i] || !frame.prepared.surfaces[i].in_video) continue;
    cv::dilate(frame.labels(box) == frame.prepared.surfaces[i].index, of_one, disc(kMixed));
    shown |= of_one & (owners != static_cast<double>(i));
  }
  return shown;
}

}  // namespace calipso::render
