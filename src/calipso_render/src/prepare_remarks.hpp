#pragma once

#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// Says in Prepared::remarks what had to be assumed or invented, and what the user can do about it.
// @param key_actors the objects at the key frame
void addRemarks(const std::vector<ClipFrame>& frames, const std::vector<Actor>& key_actors,
                Prepared& prepared);

}  // namespace calipso::render
