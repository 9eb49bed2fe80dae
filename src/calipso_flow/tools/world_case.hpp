#pragma once

#include <calipso_fem/world/world_types.hpp>

#include "calipso_flow/object_model.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::flow {

// The scene as the simulator takes it, with one of its objects.
fem::WorldScene worldOf(const Scene& scene, const ObjectModel& model);

}  // namespace calipso::flow
