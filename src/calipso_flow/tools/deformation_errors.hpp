#pragma once

#include "calipso_flow/clip_dynamics.hpp"
#include "json_entry.hpp"
#include "truth.hpp"

namespace calipso::flow {

// Adds what is known about a deforming object's wave and shape to its entry; null where there
// is no truth or no estimate.
void addDeformationErrors(const ObjectModel& model, const TrueObject& truth,
                          const ObjectDynamics& dynamics, const Eigen::Vector3d& gravity,
                          JsonEntry& entry);

}  // namespace calipso::flow
