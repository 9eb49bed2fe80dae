#pragma once

#include <string>
#include <vector>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_scene/scene.hpp"
#include "json_entry.hpp"
#include "truth.hpp"

namespace calipso::flow {

// Throws an object that moves as a rigid body on with its estimated velocity from the first frame,
// in the simulator, and adds how far its centroid then is from the true track in the picture:
// `thrown_before_px`, the largest before the first true impact, `thrown_after_px`, the largest
// after it, and `thrown_last_px` in the last frame.
void addThrow(const Scene& scene, const ObjectModel& model, const TrueObject& truth,
              const ObjectDynamics& dynamics, JsonEntry& entry);

}  // namespace calipso::flow
