#pragma once

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_scene/scene.hpp"
#include "json_entry.hpp"
#include "truth.hpp"

namespace calipso::flow {

// The last value given stands for all later frames.
const Eigen::Vector3d& valueAt(const std::vector<Eigen::Vector3d>& values, size_t k);

// Adds how far an object's velocity, spin, gravity, collisions and restitution are from the truth,
// and how often the stated interval holds the true velocity.
void addMotionErrors(const Scene& scene, const TrueObject& truth, const ObjectDynamics& dynamics,
                     JsonEntry& entry);

}  // namespace calipso::flow
