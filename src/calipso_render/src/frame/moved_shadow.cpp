#include "frame/moved_shadow.hpp"

#include "draw/side_by_side.hpp"
#include "frame/occlusion.hpp"

namespace calipso::render {

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
        on_walls = skyOnWalls(moved, place.view.relief(), frame.params);
        for (const Occluder& o : moved)
          bounds |= shadowBounds(frame, place.view.relief(), *o.vertices, frame.light.direction);
      });
}

}  // namespace calipso::render
