#pragma once

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_scene/scene.hpp"
#include "json_entry.hpp"
#include "truth.hpp"

namespace calipso::flow {

// Lets the simulator carry a deforming object on from what was measured, from two of its
// frames on, with no other edit, and adds
//   `carried_speed`             of the simulated surface over its first step along the measured
//                               velocities, over these: 1 where nothing of them is lost
//   `seen_edge_percent`         how far the mean of its lower edge, as it was tracked, goes otherwise
//                               than the true one over the next ten frames, over the true one's way
//   `carried_edge_percent`      the same as it is simulated
//   `carried_edge_correlation`  of both ways
void addCarriedOn(const Scene& scene, const ObjectModel& model, const TrueObject& truth,
                  const ObjectDynamics& dynamics, JsonEntry& entry);

}  // namespace calipso::flow
