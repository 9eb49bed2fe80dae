#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "calipso_render/visibility.hpp"
#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"
#include "place/relief_sky.hpp"

namespace calipso::render {

// What the edited objects leave of sun and sky where they are now. The sun's shade of those that
// follow the video is the video's.
struct MovedShadow {
  // The frame must outlive this.
  MovedShadow(const StagedFrame& frame, const SeenPlace& place);

  std::unique_ptr<Visibility> sun, sky;
  // What they leave of the sky where the video has them in this frame; null: it shows none of them
  // that moves, and RestingLight has it.
  std::unique_ptr<Visibility> sky_before;
  ReliefSky on_walls;  // of the sky
  cv::Rect bounds;     // of the picture: what they can shade from the sun
};

}  // namespace calipso::render
