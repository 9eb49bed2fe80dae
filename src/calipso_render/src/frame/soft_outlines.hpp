#pragma once

#include "frame/drawn_surfaces.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// Softens the outlines of what is drawn as those of the video are (Prepared::outline_blur, and
// colour_blur for colours beside their brightness), but where a surface is where the video has it:
// what drawing misses of the video is carried over there.
void softenOutlines(const StagedFrame& frame, const DrawnSurfaces& surfaces, FrameOutput& out);

}  // namespace calipso::render
