#pragma once

#include <string>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_scene/scene.hpp"
#include "truth.hpp"

namespace calipso::flow {

// Writes folder/<scene>_<object>.csv, of a further recording <scene>_<object>_<recording>.csv, one
// line per frame: estimate, its deviations and the truth, for plots.
// @param recording  see Perturbation
void writeTrace(const std::string& folder, const Scene& scene, const ObjectModel& model,
                const TrueObject& truth, const ObjectDynamics& dynamics, int recording);

}  // namespace calipso::flow
