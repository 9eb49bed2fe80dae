#pragma once

#include <optional>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// The clip without further frames most of which is white or black, as a flash or a cut leaves them:
// they show nothing of the place, and white ones would be taken for it in a brighter light. nullopt:
// there are none, or most are so.
std::optional<ClipSample> withoutBlankFrames(const ClipSample& clip);

}  // namespace calipso::render
