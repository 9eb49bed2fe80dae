#include "throw_case.hpp"

#include <algorithm>
#include <calipso_fem/world/world.hpp>
#include <cmath>

#include "world_case.hpp"

namespace calipso::flow {
namespace {

fem::ObservedMotion observed(const ObjectMotion& motion, double begin) {
  return {motion.state.time - begin, motion.moving,         motion.world_from_object,
          motion.state.position,     motion.state.velocity, motion.state.spin,
          motion.state.acceleration};
}

}  // namespace

void addThrow(const Scene& scene, const ObjectModel& model, const TrueObject& truth,
              const ObjectDynamics& dynamics, JsonEntry& entry) {
  fem::WorldParams params;
  params.frame_period = 1.0 / scene.fps;
  params.defaults.kind = ObjectKind::kRigid;
  fem::World world(worldOf(scene, model), params);
  for (const ObjectMotion& motion : dynamics.motions)
    world.addObservedMotion(model.name, observed(motion, 0.0));
  Edit edit;
  edit.object = model.name;
  edit.kind = EditKind::kVelocity;
  edit.mode = EditMode::kEstimated;
  world.submit(edit);
  const Eigen::Vector3d centre = centroid(model.mesh);
  const double impact = truth.collisions.empty() ? INFINITY : truth.collisions.front().time;
  double before = 0.0, after = truth.collisions.empty() ? NAN : 0.0, last = 0.0;
  for (size_t k = 0; k < dynamics.motions.size(); ++k) {
    const double time = dynamics.motions[k].state.time;
    world.advanceTo(time);
    const Eigen::Vector3d thrown = world.state().objects.front().world_from_object * centre;
    const Eigen::Vector3d real =
        truth.world_from_object[std::min(k, truth.world_from_object.size() - 1)] * centre;
    last = (scene.camera.projectWorld(thrown) - scene.camera.projectWorld(real)).norm();
    (time < impact ? before : after) = std::max(time < impact ? before : after, last);
  }
  entry.number("thrown_before_px", before)
      .number("thrown_after_px", after)
      .number("thrown_last_px", last);
}

}  // namespace calipso::flow
