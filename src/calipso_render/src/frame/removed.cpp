#include "frame/removed.hpp"

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

// What a box's pixels show of edited objects, with a margin, and of their passing shadows, but not
// what stands beside them.
// @param out CV_8UC1 of the box's size
void findRemoved(const StagedFrame& frame, const SeenPlace& place, const cv::Mat& passing,
                 const cv::Rect& box, cv::Mat out) {
  cv::Mat own(box.size(), CV_8U), others(box.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v)
    findShown(frame, place, v + box.y, box, own.ptr<std::uint8_t>(v), others.ptr<std::uint8_t>(v));
  const int margin = frame.params.background.mask_margin_px;
  filterTiles(own, margin, out, DiscDilation(margin));
  if (!passing.empty()) out |= passing(box);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    std::uint8_t* row = out.ptr<std::uint8_t>(v);
    const std::uint8_t* stays = others.ptr<std::uint8_t>(v);
    for (int u = 0; u < box.width; ++u) row[u] &= static_cast<std::uint8_t>(~stays[u]);
  }
}

}  // namespace

cv::Mat removedPixels(const StagedFrame& frame, const SeenPlace& place, const EditedRegion& region,
                      const cv::Mat& passing, const cv::Mat& mirrored) {
  cv::Mat removed = cv::Mat::zeros(region.all.size(), CV_8U);
  const cv::Rect& box = region.revealed;
  if (!box.empty()) findRemoved(frame, place, passing, box, removed(box - region.all.tl()));
  const cv::Mat& lost = frame.prepared.mirror.lost;
  if (!mirrored.empty() && !lost.empty())
    removed |= lost(region.all) & (mirrored(region.all) == Reflections::kChanged) &
               (frame.labels(region.all) == 0);
  for (const cv::Mat& front : place.fronts) {
    if (!front.empty()) removed.setTo(0, front(region.all));
  }
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

}  // namespace calipso::render
