#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "describe.hpp"
#include "world_impl.hpp"

// What an edit does to an object as a whole. Each function returns what was done, or throws what is
// wrong.
namespace calipso::fem {
namespace {

double changed(double value, double by, EditMode mode) {
  if (std::isnan(by)) return value;
  return mode == EditMode::kFactor ? value * by : by;
}

bool changesStiffness(const Edit& edit) {
  return !std::isnan(edit.youngs_modulus) || !std::isnan(edit.poissons_ratio) ||
         !std::isnan(edit.damping);
}

// The edit's turn about a point and its translation, world.
Eigen::Isometry3d motionAbout(const Eigen::Vector3d& point, const Edit& edit) {
  return Eigen::Translation3d(point + edit.translation) * edit.rotation.normalized() *
         Eigen::Translation3d(-point);
}

}  // namespace

// The simplest kind that an edit can act on.
ObjectKind World::Impl::kindFor(const Actor& actor, const Edit& edit) const {
  switch (edit.kind) {
    case EditKind::kPull:
    case EditKind::kFix:
    case EditKind::kRelease:
    case EditKind::kTwist:
    case EditKind::kPressure:
      return ObjectKind::kDeformable;
    case EditKind::kMaterial:
      if (changesStiffness(edit)) return ObjectKind::kDeformable;
      [[fallthrough]];  // density
    case EditKind::kGravity:
    case EditKind::kVelocity:
    case EditKind::kWind:
      // What is attached can only give way elastically.
      return actor.holder == Holder::kAttachment ? ObjectKind::kDeformable : ObjectKind::kRigid;
    case EditKind::kObjectKind:
      return edit.object_kind;
    case EditKind::kInsert:
    case EditKind::kDuplicate:  // nothing but physics moves what is new
      return isCloth(actor.object.mesh, massProperties(actor.object.mesh, 1.0).mass)
                 ? ObjectKind::kDeformable
                 : ObjectKind::kRigid;
    case EditKind::kTransform:
      return ObjectKind::kKinematic;
    default:
      return ObjectKind::kStatic;
  }
}

void World::Impl::checkThere(const Actor& actor) const {
  if (!actor.removed) return;
  throw std::invalid_argument(
      actor.object.name + " has been removed; " +
      (actor.inserted ? "insert it again under another name" : "send a reset for it first"));
}

// Makes the object a body that this edit, and those known to come, can act on.
void World::Impl::touch(Actor& actor, const Edit& edit) {
  checkThere(actor);
  if (actor.followsVideo()) findHolder(actor);
  noteWhatRestsOn(actor);
  ObjectKind kind = std::max(actor.kind, kindFor(actor, edit));
  std::string reason = "edit '" + toString(edit.kind) + "'";
  for (const Edit& later : pending) {
    if (&later == &pending.front() || later.object != actor.object.name) continue;
    if (later.kind == EditKind::kReset || later.kind == EditKind::kObjectKind) break;
    if (later.kind == EditKind::kDuplicate) continue;  // acts on the copy alone
    const ObjectKind needed = kindFor(actor, later);
    if (needed > kind) {
      kind = needed;
      reason = "edit '" + toString(later.kind) + "' to come";
    }
  }
  if (actor.settings.kind) {
    kind = *actor.settings.kind;
    reason = "its parameter 'kind'";
  }
  if (actor.forced_kind) {
    kind = *actor.forced_kind;
    reason = "edit 'kind'";
  }
  become(actor, kind, reason);
  wake(actor);
}

std::string World::Impl::touchIfPossible(Actor& actor, const Edit& edit) {
  try {
    touch(actor, edit);
  } catch (const std::invalid_argument& error) {
    if (!edit.object.empty()) throw;
    return error.what();
  }
  return {};
}

std::string World::Impl::apply(const Edit& edit) {
  std::vector<bool> fresh;
  for (const Actor& actor : actors) fresh.push_back(actor.kind == ObjectKind::kStatic);
  const std::string done = carryOut(edit);
  noteWhatContinues(edit, fresh);
  return done;
}

std::string World::Impl::carryOut(const Edit& edit) {
  validate(edit, names());
  if (!edit.after.empty())
    throw std::invalid_argument("collision " + std::to_string(edit.collision) + " of " +
                                edit.after + " is not in the video, which shows " +
                                std::to_string(find(edit.after)->collisions.size()));
  if (edit.object.empty()) return applyToScene(edit);
  if (edit.kind == EditKind::kGravity) return changeGravity(edit);
  Actor& actor = *find(edit.object);
  switch (edit.kind) {
    case EditKind::kTransform:
      return transform(actor, edit);
    case EditKind::kPull:
    case EditKind::kTwist:
      return pull(actor, edit);
    case EditKind::kFix:
      return fix(actor, edit);
    case EditKind::kRelease:
      return release(actor, edit);
    case EditKind::kPressure:
      return press(actor, edit);
    case EditKind::kWind:
      return blow(actor, edit);
    case EditKind::kMaterial:
      return changeMaterial(actor, edit);
    case EditKind::kVelocity:
      return changeVelocity(actor, edit);
    case EditKind::kContact:
      return changeContact(actor, edit);
    case EditKind::kDuplicate:
      return copy(actor, edit);
    case EditKind::kAppearance:
      return changeLook(actor, edit);
    case EditKind::kObjectKind:
      return changeKind(actor, edit);
    case EditKind::kRemove:
      return remove(actor);
    case EditKind::kReset:
      reset(actor);
      return actor.object.name + (actor.inserted ? " is gone: the video does not have it"
                                                 : " is as in the video again");
    default:
      throw std::invalid_argument("an edit '" + toString(edit.kind) +
                                  "' is for the whole scene; leave object out");
  }
}

std::string World::Impl::transform(Actor& actor, const Edit& edit) {
  touch(actor, edit);
  const bool deformed = actor.soft != nullptr;
  if (edit.scale != 1.0) scale(actor, edit.scale);
  moveBy(actor, motionAbout(centroidOf(actor), edit));
  std::string message = actor.object.name + " is moved by " + describe(edit.translation) + " m";
  if (edit.scale != 1.0) message += " and scaled by " + std::to_string(edit.scale);
  if (edit.scale != 1.0 && deformed && !actor.drive)
    message += "; it starts anew from its undeformed shape";
  for (const std::string& overlap :
       overlapsOf(actor, {verticesOf(actor), actor.object.mesh.triangles}))
    message += "; it is " + overlap;
  return message;
}

void World::Impl::moveBy(Actor& actor, const Eigen::Isometry3d& motion) {
  wakeAround(actor);
  actor.placement = motion * actor.placement;
  if (actor.soft) {
    actor.soft->body().applyRigidTransform(motion);
    for (Pull& pull : actor.pulls) pull.moveBy(motion, pull.share(now));
    holdAnew(actor);
    actor.soft->changed();
    contacts.forget(actor.id);
  } else if (actor.kind == ObjectKind::kRigid) {
    rigid.setPose(*actor.body, motion * rigid.pose(*actor.body));
    for (Pull& pull : actor.pulls) pull.moveBy(motion, pull.share(now));
  } else {
    if (actor.body) rigid.setPose(*actor.body, poseOf(actor, now));
  }
  meetOwnSupports(actor, false);
  wakeAround(actor);
}

void World::Impl::scale(Actor& actor, double factor) {
  const Eigen::RowVector3d middle = actor.object.mesh.vertices.colwise().mean();
  TriangleMesh mesh = actor.object.mesh;
  mesh.vertices = (factor * (mesh.vertices.rowwise() - middle)).rowwise() + middle;
  const bool driven = actor.drive != nullptr;
  Body body = bodyOf(actor, mesh, actor.kind, driven ? keyPlaceOf(actor) : motionOf(actor));
  const Eigen::Vector3d own = middle.transpose(), placed = poseOf(actor, now) * own;
  for (Pull& pull : actor.pulls) {
    pull.anchor = own + factor * (pull.anchor - own);
    pull.scaleBy(factor, placed, pull.share(now));
  }
  actor.object.mesh = mesh;
  actor.scale *= factor;
  actor.tree.reset();
  enter(actor, std::move(body), false);
  if (driven) deformAsObserved(actor);  // the video drives it on
  wake(actor);
}

std::string World::Impl::changeMaterial(Actor& actor, const Edit& edit) {
  Material material = actor.material;
  material.youngs_modulus = changed(material.youngs_modulus, edit.youngs_modulus, edit.mode);
  const bool immovable = std::isinf(edit.density);
  if (!immovable) material.density = changed(material.density, edit.density, edit.mode);
  material.poissons_ratio =
      changed(material.poissons_ratio, edit.poissons_ratio, EditMode::kAbsolute);
  material.damping = changed(material.damping, edit.damping, EditMode::kAbsolute);
  validate(material);
  if (immovable) return makeImmovable(actor, edit, material);
  if (edit.mode == EditMode::kAbsolute && !std::isnan(edit.density)) actor.immovable = false;
  touch(actor, edit);  // may find a default stiffness that carries it
  const bool told = tellsDensity(actor, edit);
  material.youngs_modulus = changed(actor.material.youngs_modulus, edit.youngs_modulus, edit.mode);
  setMaterial(actor, edit, material);
  if (actor.soft) actor.soft->setMaterial(material);
  if (actor.kind == ObjectKind::kRigid)
    rigid.setMass(*actor.body, massProperties(actor.object.mesh, material.density));
  applyGravity(actor);
  plan_changed = true;
  std::ostringstream text;
  text << actor.object.name << ": E = " << material.youngs_modulus
       << " Pa, nu = " << material.poissons_ratio << ", density = " << material.density
       << " kg/m^3, damping = " << material.damping << " s";
  if (told) text << "; it floats with this density, as in the video";
  return text.str();
}

// The default density is water's, and what floats is no denser: the first one in kg/m^3 up to that
// is what it has in the video. One that is given changes its weight, as a factor does.
bool World::Impl::tellsDensity(Actor& actor, const Edit& edit) {
  const bool first = edit.mode == EditMode::kAbsolute && !std::isnan(edit.density) &&
                     !actor.settings.density && actor.holder == Holder::kBuoyancy;
  if (!first || edit.density > actor.observed_material.density) return false;
  actor.settings.density = actor.observed_material.density = edit.density;
  return true;
}

void World::Impl::setMaterial(Actor& actor, const Edit& edit, const Material& material) {
  actor.material = material;
  actor.stiffness_given |= edit.mode == EditMode::kAbsolute && !std::isnan(edit.youngs_modulus);
  actor.sheet.reset();
}

// Goes on as the video shows, or stays where an edit has put it, whatever pushes.
std::string World::Impl::makeImmovable(Actor& actor, const Edit& edit, const Material& material) {
  actor.immovable = true;
  touch(actor, edit);
  setMaterial(actor, edit, material);  // for when it is given a mass again
  become(actor, ObjectKind::kKinematic, "its mass is infinite");
  return actor.object.name + " has infinite mass: nothing moves it";
}

std::string World::Impl::changeVelocity(Actor& actor, const Edit& edit) {
  if (edit.mode == EditMode::kEstimated && actor.track.empty())
    throw std::invalid_argument("the velocity of " + actor.object.name +
                                " in the video is not known; use mode absolute and give a vector");
  touch(actor, edit);
  if (!actor.simulated())
    throw std::invalid_argument(actor.object.name + " is " + toString(actor.kind) +
                                " and has no velocity to change; make it rigid or deformable");
  const BodyMotion motion = motionOf(actor);
  Eigen::Vector3d linear = edit.vector, angular = edit.angular;
  if (edit.mode == EditMode::kAdd) {
    linear += motion.linear;
    angular += motion.angular;
  } else if (edit.mode == EditMode::kEstimated) {
    const BodyMotion seen = seenMotionOf(actor);
    linear = edit.factor * seen.linear;
    angular = edit.factor * seen.angular;
  }
  if (actor.soft && edit.mode == EditMode::kAdd) {
    DeformableBody& body = actor.soft->body();
    const Vec x = body.positions();
    Vec v = body.velocities();
    const Eigen::Vector3d center = body.momentum().center;
    for (int i = 0; i < body.nodeCount(); ++i)
      v.segment<3>(3 * i) += edit.vector + edit.angular.cross(x.segment<3>(3 * i) - center);
    body.setState(x, v);
  } else if (actor.soft && edit.mode == EditMode::kEstimated && actor.modes.cols() > 0) {
    DeformableBody& body = actor.soft->body();
    body.setState(body.positions(),
                  edit.factor * nodalModes(actor, actor.track.at(now).mode_velocities));
    return actor.object.name + " moves with " + std::to_string(edit.factor) +
           " of the velocity it deforms with";
  } else {
    setVelocity(actor, linear, angular);
  }
  return actor.object.name + " moves with " + describe(linear) + " m/s, " + describe(angular) +
         " rad/s";
}

void World::Impl::setVelocity(Actor& actor, const Eigen::Vector3d& linear,
                              const Eigen::Vector3d& angular) {
  if (actor.soft) actor.soft->body().setRigidVelocity(linear, angular);
  if (actor.kind == ObjectKind::kRigid) rigid.setVelocity(*actor.body, linear, angular);
}

std::string World::Impl::remove(Actor& actor) {
  noteWhatRestsOn(actor);
  removeBodies(actor);
  meetOwnSupports(actor, false);
  actor.removed = actor.edited = true;
  actor.kind = ObjectKind::kStatic;
  actor.reason = "edit 'remove'";
  plan_changed = true;
  return actor.object.name + " is removed";
}

// Moved like edit 'transform' moves, from where the original is now and with its velocity.
std::string World::Impl::copy(Actor& actor, const Edit& edit) {
  checkThere(actor);
  const Eigen::Vector3d centroid = centroidOf(actor);
  const Eigen::Isometry3d motion = motionAbout(centroid, edit);
  const BodyMotion moves = motionOf(actor);
  const Holder known = actor.holder;
  findHolder(actor);  // what floats has a copy that floats
  Actor& fresh = duplicate(actor.object.name, edit.new_name, motion);
  actor.holder = known;
  fresh.source = actor.source.empty() && !actor.inserted ? actor.object.name : actor.source;
  fresh.look = actor.look;
  fresh.edited = true;
  if (edit.scale != 1.0) scale(fresh, edit.scale);
  if (!fresh.simulated()) {
    touch(fresh, edit);
    setVelocity(fresh, motion.linear() * moves.linear, motion.linear() * moves.angular);
  }
  if (wind_now && fresh.air.empty()) blow(fresh, *wind_now);
  return edit.new_name + " is a copy of " + actor.object.name + ", moved by " +
         describe(edit.translation) + " m";
}

std::string World::Impl::changeKind(Actor& actor, const Edit& edit) {
  const auto before = std::exchange(actor.forced_kind, edit.object_kind);
  try {
    touch(actor, edit);
  } catch (...) {
    actor.forced_kind = before;
    throw;
  }
  return actor.object.name + " is " + toString(actor.kind) + " now";
}

// Only the picture changes: edits to come find the object as the video has it.
std::string World::Impl::changeLook(Actor& actor, const Edit& edit) {
  checkThere(actor);
  if (actor.followsVideo()) actor.reason = "edit 'appearance'", plan_changed = true;
  actor.edited = true;
  Look& look = actor.look;
  if (edit.color.allFinite()) {
    const bool replaces = edit.mode == EditMode::kAbsolute;
    look.color =
        look.absolute && !replaces ? look.color.cwiseProduct(edit.color).eval() : edit.color;
    look.absolute |= replaces;
  }
  if (!std::isnan(edit.specular)) look.specular = edit.specular;
  if (!std::isnan(edit.roughness)) look.roughness = edit.roughness;
  return actor.object.name + " looks different";
}

}  // namespace calipso::fem
