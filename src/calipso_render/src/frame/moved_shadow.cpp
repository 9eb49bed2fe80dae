#include "frame/moved_shadow.hpp"

#include <optional>
#include <utility>
#include <vector>

#include "draw/side_by_side.hpp"
#include "frame/occlusion.hpp"

namespace calipso::render {
namespace {

// The edited objects' sky as the video has them now; null where none is known to move.
std::unique_ptr<Visibility> skyOfObserved(const StagedFrame& frame) {
  std::vector<Points> points;
  std::vector<int> surfaces;
  bool moves = false;
  for (int i = 0; i < static_cast<int>(frame.edited.size()); ++i) {
    const Surface& s = frame.prepared.surfaces[i];
    if (!frame.edited[i] || !s.in_video) continue;
    std::optional<Points> now = frame.observed(i);
    if (frame.prepared.moves[i] && !now) continue;
    moves = moves || frame.prepared.moves[i];
    points.push_back(frame.prepared.moves[i] ? *std::move(now) : s.key_vertices);
    surfaces.push_back(i);
  }
  if (!moves) return nullptr;
  std::vector<Occluder> occluders;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Surface& s = frame.prepared.surfaces[surfaces[k]];
    occluders.push_back({&points[k], &s.triangles, s.winding});
  }
  return skyVisibility(occluders, frame.params);
}

}  // namespace

MovedShadow::MovedShadow(const StagedFrame& frame, const SeenPlace& place) {
  std::vector<Occluder> moved;
  for (const StagedObject& object : frame.objects) {
    if (object.edited) moved.push_back(object.occluder());
  }
  sideBySide(
      frame.params.quality == Quality::kLive,
      [&] { sun = sunVisibility(moved, frame.light, frame.params); },
      [&] {
        sky = skyVisibility(moved, frame.params);
        sky_before = skyOfObserved(frame);
        on_walls = skyOnWalls(moved, place.view.relief(), frame.params);
        for (const Occluder& o : moved)
          bounds |= shadowBounds(frame, place.view.relief(), *o.vertices, frame.light.direction);
      });
}

}  // namespace calipso::render
