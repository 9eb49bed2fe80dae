#include "frame/moved_shadow.hpp"

#include <vector>

#include "draw/side_by_side.hpp"
#include "frame/occlusion.hpp"

namespace calipso::render {
namespace {

// The sky that edited objects leave where the video has them now; null: it shows none that moves.
std::unique_ptr<Visibility> skyOfObserved(const StagedFrame& frame) {
  std::vector<Occluder> occluders;
  bool moves = false;
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    const Surface& s = frame.prepared.surfaces[i];
    const bool shown = frame.observed[i] || !frame.prepared.moves[i];
    if (!frame.edited[i] || !s.in_video || !shown) continue;
    moves |= frame.observed[i].has_value();
    occluders.push_back(
        {frame.observed[i] ? &*frame.observed[i] : &s.key_vertices, &s.triangles, s.winding});
  }
  return moves ? skyVisibility(occluders, frame.params) : nullptr;
}

}  // namespace

MovedShadow::MovedShadow(const StagedFrame& frame, const SeenPlace& place) {
  std::vector<Occluder> edited, moved;
  for (const StagedObject& object : frame.objects) {
    if (object.edited) edited.push_back(object.occluder());
    if (frame.casts(object.surface)) moved.push_back(object.occluder());
  }
  sideBySide(
      frame.params.quality == Quality::kLive,
      [&] { sun = sunVisibility(moved, frame.light, frame.params); },
      [&] {
        sky = skyVisibility(edited, frame.params);
        sky_before = skyOfObserved(frame);
        on_walls = skyOnWalls(moved, place.view.relief(), frame.params);
        for (const Occluder& o : moved)
          bounds |= shadowBounds(frame, place.view.relief(), *o.vertices, frame.light.direction);
      });
}

}  // namespace calipso::render
