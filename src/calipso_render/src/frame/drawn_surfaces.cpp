#include "frame/drawn_surfaces.hpp"

#include <algorithm>
#include <cstring>

#include "draw/wide_loops.hpp"

namespace calipso::render {
namespace {

CALIPSO_WIDE_LOOPS void markSeen(const std::uint32_t* ids, int count, std::uint8_t* seen) {
  for (int i = 0; i < count; ++i) seen[i] = ids[i] != VisibilityBuffer::kNothing ? 255 : 0;
}

std::vector<const ScreenMesh*> screensOf(const StagedFrame& frame) {
  std::vector<const ScreenMesh*> screens;
  for (const StagedObject& object : frame.objects) screens.push_back(&object.actor.screen);
  return screens;
}

}  // namespace

DrawnSurfaces::DrawnSurfaces(const StagedFrame& frame, const SeenPlace& place,
                             const EditedRegion& region, const cv::Mat& removed)
    : frame_(frame),
      place_(place),
      region_(region.all),
      box_(region.drawn),
      removed_(removed),
      centre_(region.all, screensOf(frame)) {
  for (const StagedObject& object : frame.objects)
    always_drawn_.push_back(object.edited && place.fronts[object.surface].empty());
  all_drawn_ =
      std::all_of(always_drawn_.begin(), always_drawn_.end(), [](bool always) { return always; });
  findMask();
  if (!box_.empty())
    covered_ =
        SquareMask(mask_(box_ - region_.tl()), box_, frame.params.background.shadow_margin_px + 2);
}

void DrawnSurfaces::findMask() {
  mask_.create(region_.size(), CV_8U);
  const cv::Rect box = box_ - region_.tl();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    const std::uint32_t* ids = centre_.ids(v);
    std::uint8_t* drawn = mask_.ptr<std::uint8_t>(v);
    std::memset(drawn, 0, region_.width);
    if (v < box.y || v >= box.br().y) continue;
    if (all_drawn_) {
      markSeen(ids + box.x, box.width, drawn + box.x);
    } else {
      for (int u = box.x; u < box.br().x; ++u)
        drawn[u] = isDrawn(ids[u], u + region_.x, v + region_.y) ? 255 : 0;
    }
  }
}

bool DrawnSurfaces::isDrawn(std::uint32_t id, int u, int v) const {
  if (id == VisibilityBuffer::kNothing) return false;
  if (always_drawn_[VisibilityBuffer::objectOf(id)]) return true;
  const StagedObject& object = frame_.objectOf(id);
  if (place_.hides(object.surface, u, v)) return false;
  return object.edited || removed_.at<std::uint8_t>(v - region_.y, u - region_.x) != 0;
}

EdgeCoverage DrawnSurfaces::sampleEdges() const {
  EdgeCoverage edges(centre_, box_ - region_.tl());
  for (const StagedObject& object : frame_.objects) {
    if (object.edited)
      edges.chooseSilhouette(object.actor.screen, object.actor.surface->edges, centre_);
  }
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot)
    edges.draw(frame_.objects[slot].actor.screen, static_cast<int>(slot));
  edges.settle(centre_);
  return edges;
}

}  // namespace calipso::render
