#pragma once

#include <optional>

#include "calipso_align/alignment.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::align {

// The scene's depth image of the key frame, or nothing when it has none.
// @throw std::runtime_error naming file, what is wrong and the remedy
std::optional<DepthObservation> loadDepth(const Scene& scene);

}  // namespace calipso::align
