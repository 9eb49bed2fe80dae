#include "frame/edited_region.hpp"

#include <algorithm>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "frame/mask_morphology.hpp"

namespace calipso::render {
namespace {

constexpr int kMargin = 8;  // px

cv::Rect boxOf(const cv::Mat& mask) { return mask.empty() ? cv::Rect() : cv::boundingRect(mask); }

// Bounding box of an object's pixels.
cv::Rect boxOf(const cv::Mat& labels, int index) {
  if (index < 0) return {};  // the video does not have it
  int left = labels.cols, right = -1, top = labels.rows, bottom = -1;
  for (int v = 0; v < labels.rows; ++v) {
    const std::uint8_t* row = labels.ptr<std::uint8_t>(v);
    const void* first = std::memchr(row, index, labels.cols);
    if (first == nullptr) continue;
    top = std::min(top, v), bottom = v;
    left = std::min(left, static_cast<int>(static_cast<const std::uint8_t*>(first) - row));
    const void* last = memrchr(row, index, labels.cols);
    right = std::max(right, static_cast<int>(static_cast<const std::uint8_t*>(last) - row));
  }
  return bottom < 0 ? cv::Rect() : cv::Rect({left, top}, cv::Point(right + 1, bottom + 1));
}

}  // namespace

EditedRegion::EditedRegion(const StagedFrame& frame, const RestingLight& resting,
                           const MovedShadow& moved, const ShadedOthers& others,
                           const Reflections& reflections, const cv::Mat& passing) {
  cv::Rect shown;  // edited objects in the video
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    if (frame.edited[i]) shown |= boxOf(frame.labels, frame.prepared.surfaces[i].index);
  }
  all = grown(shown, kMargin);
  for (std::size_t slot = 0; slot < frame.objects.size(); ++slot) {
    const StagedObject& object = frame.objects[slot];
    const cv::Rect box = boundsOf(object.actor.screen, kMargin, frame.input.bgr.size());
    if (object.edited || others.maybe(slot)) all |= box;
    drawn |= box;
  }
  all |= resting.bounds() | resting.shadedBox() | moved.bounds;
  const cv::Mat& lost = frame.prepared.mirror.lost;
  cv::Mat mirrored;
  if (!reflections.marks().empty()) mirrored = reflections.marks() == Reflections::kChanged;
  all |= boxOf(passing) | boxOf(mirrored);
  all &= frame.whole(), drawn &= all;
  const int margin = frame.params.background.mask_margin_px;
  revealed = grown(shown | resting.footprints(), margin) | boxOf(passing);
  if (!mirrored.empty() && !lost.empty()) revealed |= boxOf(mirrored & lost);
  revealed &= all;
}

}  // namespace calipso::render
