#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "describe.hpp"
#include "world_impl.hpp"

// Edits of the whole scene, and of what two objects are to each other.
namespace calipso::fem {
namespace {

bool pointsAlong(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  constexpr double kSlant = 0.05;  // rad: what is seen of a fall errs by some hundredths
  return a.dot(b) > 0.0 && a.cross(b).norm() <= kSlant * a.norm() * b.norm();
}

}  // namespace

std::string World::Impl::applyToScene(const Edit& edit) {
  switch (edit.kind) {
    case EditKind::kGravity:
      return changeGravity(edit);
    case EditKind::kWind:
      return blowEverywhere(edit);
    case EditKind::kSpeedScale:
      speed_scale = edit.factor;
      return "what is simulated runs at " + std::to_string(edit.factor) + " of the video's speed";
    case EditKind::kTimeScale:
      return "the video runs at " + std::to_string(edit.factor) + " of its speed";
    case EditKind::kInsert:
      return insert(edit);
    case EditKind::kLight:
      sun = {edit.vector, edit.factor};
      return "the sun stands towards " + describe(edit.vector);
    default:
      gravity_now = scene.gravity;
      wind_now.reset();
      for (Actor& actor : actors) reset(actor);
      sun = Sun();
      speed_scale = 1.0;
      return "every object is as in the video again";
  }
}

std::string World::Impl::changeGravity(const Edit& edit) {
  if (edit.mode == EditMode::kEstimated && !observed_gravity)
    throw std::invalid_argument(
        "nothing was seen to fall in the video; give gravity by mode absolute or factor");
  const Eigen::Vector3d replaced =
      edit.mode == EditMode::kEstimated ? observed_gravity->vector : edit.vector;
  if (edit.object.empty())
    gravity_now = edit.mode == EditMode::kFactor ? edit.factor * gravity_now : replaced;
  std::string changed_objects;
  for (Actor& actor : actors) {
    if (actor.removed || (!edit.object.empty() && actor.object.name != edit.object)) continue;
    const Eigen::Vector3d gravity =
        edit.mode == EditMode::kFactor ? edit.factor * actor.gravity : replaced;
    // A change for the whole scene leaves alone what goes on lying on its support: under gravity
    // that slants it may slide.
    if (edit.object.empty() && actor.followsVideo()) {
      findHolder(actor);
      if (actor.holder == Holder::kSupport && pointsAlong(gravity, scene.gravity)) {
        actor.gravity = gravity;
        continue;
      }
    }
    const std::string stays = touchIfPossible(actor, edit);
    actor.gravity = gravity;
    if (!stays.empty()) {
      changed_objects += " " + actor.object.name + " stays: " + stays + ";";
      continue;
    }
    applyGravity(actor);
    changed_objects += " " + actor.object.name + " " + describe(gravity) + " m/s^2;";
  }
  return changed_objects.empty() ? "gravity changed; every object goes on resting"
                                 : "gravity:" + changed_objects;
}

void World::Impl::applyGravity(Actor& actor) {
  if (actor.soft) actor.soft->setGravity(actor.acceleration());
  if (actor.kind == ObjectKind::kRigid) rigid.setAcceleration(*actor.body, actor.acceleration());
}

std::string World::Impl::blowEverywhere(const Edit& edit) {
  std::string message;
  for (Actor& actor : actors) {
    if (!actor.removed) message += (message.empty() ? "" : "; ") + blow(actor, edit);
  }
  wind_now = edit;
  return message.empty() ? "there is nothing that wind could move" : message;
}

// A CAD model that the video does not have. It is rigid unless it is cloth, or an edit to
// come needs more.
std::string World::Impl::insert(const Edit& edit) {
  WorldObject object;
  object.name = edit.new_name;
  object.index = freeIndex();
  try {
    object.mesh = loadMesh((std::filesystem::path(scene.directory) / edit.model_path).string());
  } catch (const std::runtime_error& error) {
    throw std::invalid_argument(error.what());
  }
  object.mesh.vertices *= edit.scale;
  object.world_from_object.linear() = edit.rotation.normalized().toRotationMatrix();
  object.world_from_object.translation() =
      edit.translation -
      object.world_from_object.linear() * object.mesh.vertices.colwise().mean().transpose();
  ObjectSettings settings = params.settingsOf(object.name);
  const auto give = [](double value, std::optional<double>& to) {
    if (!std::isnan(value)) to = value;
  };
  give(edit.youngs_modulus, settings.youngs_modulus);
  give(edit.poissons_ratio, settings.poissons_ratio);
  give(edit.density, settings.density);
  give(edit.damping, settings.damping);
  if (!std::isnan(edit.friction)) settings.surface.friction = edit.friction;
  if (!std::isnan(edit.restitution)) settings.surface.restitution = edit.restitution;
  Actor& fresh = addObject(object, settings);
  const Eigen::Vector3d grey = Eigen::Vector3d::Constant(0.5);
  fresh.look = {edit.color.allFinite() ? edit.color : grey, true, edit.specular, edit.roughness};
  touch(fresh, edit);
  if (wind_now) blow(fresh, *wind_now);
  return object.name + " is a new object at " + describe(edit.translation) + " m";
}

std::string World::Impl::changeContact(Actor& actor, const Edit& edit) {
  const bool of_pairs =
      !edit.other.empty() || (std::isnan(edit.friction) && std::isnan(edit.restitution));
  if (of_pairs) rememberRules(actor.object.name, edit.other);
  if (std::isnan(edit.friction) && std::isnan(edit.restitution)) {
    setPairContact(actor.object.name, edit.other, edit.meet);
    const std::string other = edit.other == actor.object.name ? "itself" : edit.other;
    return actor.object.name + (edit.meet ? " meets " : " does not meet ") +
           (other.empty() ? "anything" : other);
  }
  if (edit.other.empty()) {
    SurfaceSettings surface = actor.settings.surface;
    if (!std::isnan(edit.friction)) surface.friction = edit.friction;
    if (!std::isnan(edit.restitution)) surface.restitution = edit.restitution;
    setSurface(actor, surface);
  } else {
    PairRule rule = pairRule(actor.object.name, edit.other);
    rule.contact = edit.meet;
    if (!std::isnan(edit.friction)) rule.friction = edit.friction;
    if (!std::isnan(edit.restitution)) rule.restitution = edit.restitution;
    setPairRule(actor.object.name, edit.other, rule);
  }
  return "the surface of " + actor.object.name + " has changed" +
         (edit.other.empty() ? "" : " towards " + edit.other);
}

}  // namespace calipso::fem
