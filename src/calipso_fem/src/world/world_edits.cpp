#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "calipso_fem/world/region_selection.hpp"
#include "world_impl.hpp"

// What an edit does. Each function returns what was done, or throws what is wrong.
namespace calipso::fem {
namespace {

std::string describe(const Eigen::Vector3d& v) {
  std::ostringstream text;
  text << "(" << v.x() << ", " << v.y() << ", " << v.z() << ")";
  return text.str();
}

bool intersects(const std::vector<int>& a, const std::vector<int>& b) {  // both ascending
  std::vector<int> common;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
  return !common.empty();
}

Eigen::Vector3d meanOf(const decltype(TriangleMesh::vertices)& vertices,
                       const std::vector<int>& chosen) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int v : chosen) sum += vertices.row(v).transpose();
  return sum / static_cast<double>(chosen.size());
}

double changed(double value, double by, EditMode mode) {
  if (std::isnan(by)) return value;
  return mode == EditMode::kFactor ? value * by : by;
}

bool changesStiffness(const Edit& edit) {
  return !std::isnan(edit.youngs_modulus) || !std::isnan(edit.poissons_ratio) ||
         !std::isnan(edit.damping);
}

}  // namespace

// The simplest kind that an edit can act on.
ObjectKind World::Impl::kindFor(const Actor& actor, const Edit& edit) const {
  switch (edit.kind) {
    case EditKind::kPull:
    case EditKind::kFix:
    case EditKind::kRelease:
      return ObjectKind::kDeformable;
    case EditKind::kMaterial:
      return changesStiffness(edit) ? ObjectKind::kDeformable : ObjectKind::kRigid;
    case EditKind::kGravity:
    case EditKind::kVelocity:
      // What is attached can only give way elastically.
      return actor.holder == Holder::kAttachment ? ObjectKind::kDeformable : ObjectKind::kRigid;
    case EditKind::kObjectKind:
      return edit.object_kind;
    case EditKind::kTransform:
      return ObjectKind::kKinematic;
    default:
      return ObjectKind::kStatic;
  }
}

// Makes the object a body that this edit, and those known to come, can act on.
void World::Impl::touch(Actor& actor, const Edit& edit) {
  if (actor.removed)
    throw std::invalid_argument(actor.object.name + " has been removed; send a reset for it first");
  if (!actor.edited) findHolder(actor);
  ObjectKind kind = std::max(actor.kind, kindFor(actor, edit));
  std::string reason = "edit '" + toString(edit.kind) + "'";
  for (const Edit& later : pending) {
    if (&later == &pending.front() || later.object != actor.object.name) continue;
    if (later.kind == EditKind::kReset || later.kind == EditKind::kObjectKind) break;
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

std::string World::Impl::apply(const Edit& edit) {
  validate(edit, names());
  if (edit.kind == EditKind::kGravity) return changeGravity(edit);
  if (edit.kind == EditKind::kReset && edit.object.empty()) {
    for (Actor& actor : actors) reset(actor);
    return "every object is as in the video again";
  }
  Actor& actor = *find(edit.object);
  switch (edit.kind) {
    case EditKind::kTransform:
      return transform(actor, edit);
    case EditKind::kPull:
      return pull(actor, edit);
    case EditKind::kFix:
      return fix(actor, edit);
    case EditKind::kRelease:
      return release(actor, edit);
    case EditKind::kMaterial:
      return changeMaterial(actor, edit);
    case EditKind::kVelocity:
      return changeVelocity(actor, edit);
    case EditKind::kObjectKind: {
      actor.forced_kind = edit.object_kind;
      touch(actor, edit);
      return actor.object.name + " is " + toString(actor.kind) + " now";
    }
    case EditKind::kRemove: {
      removeBodies(actor);
      actor.removed = actor.edited = true;
      actor.kind = ObjectKind::kStatic;
      actor.reason = "edit 'remove'";
      plan_changed = true;
      return actor.object.name + " is removed";
    }
    default:
      reset(actor);
      return actor.object.name + " is as in the video again";
  }
}

std::string World::Impl::transform(Actor& actor, const Edit& edit) {
  touch(actor, edit);
  const Eigen::Vector3d centroid = centroidOf(actor);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = edit.rotation.normalized().toRotationMatrix();
  motion.translation() = centroid + edit.translation - motion.linear() * centroid;
  if (actor.soft) {
    actor.soft->body().applyRigidTransform(motion);
    actor.soft->changed();
    contacts.forget(actor.id);
  } else if (actor.kind == ObjectKind::kRigid) {
    rigid.setPose(*actor.body, motion * rigid.pose(*actor.body));
  } else {
    actor.placement = motion * actor.placement;
    if (actor.body) rigid.setPose(*actor.body, poseOf(actor, now));
  }
  std::string message = actor.object.name + " is moved by " + describe(edit.translation) + " m";
  if (edit.scale == 1.0) return message;
  const Eigen::RowVector3d middle = actor.object.mesh.vertices.colwise().mean();
  actor.object.mesh.vertices =
      (edit.scale * (actor.object.mesh.vertices.rowwise() - middle)).rowwise() + middle;
  const bool deformed = actor.soft != nullptr;
  rebuild(actor);
  message += " and scaled by " + std::to_string(edit.scale);
  return deformed ? message + "; it starts anew from its undeformed shape" : message;
}

std::string World::Impl::pull(Actor& actor, const Edit& edit) {
  Pull pull;
  pull.vertices = selectVertices(scene, actor.id, edit.region);
  pull.to_target = edit.mode == EditMode::kTarget;
  pull.vector = edit.vector;
  pull.begin = now;
  pull.ramp = edit.ramp;
  pull.duration = edit.duration;
  touch(actor, edit);
  if (!actor.simulated())
    throw std::invalid_argument(actor.object.name + " is " + toString(actor.kind) +
                                " and cannot be pulled; make it rigid or deformable (edit 'kind')");
  pull.anchor = meanOf(actor.object.mesh.vertices, pull.vertices);
  pull.start = meanOf(verticesOf(actor), pull.vertices);
  if (actor.soft && pull.to_target) {
    DeformableBody& body = actor.soft->body();
    const double start = body.time(), begin = now;
    for (const int node : body.nodesOfSurfaceVertices(pull.vertices)) {
      if (body.isFixed(node)) continue;
      pull.nodes.push_back(node);
      const Eigen::Vector3d from =
          body.positions().segment<3>(3 * node) - body.model().mesh().node(node);
      for (int axis = 0; axis < 3; ++axis)
        body.prescribe(node, axis, [pull, start, begin, axis, d = from[axis]](double t) {
          return d + pull.share(begin + t - start) * pull.vector[axis];
        });
    }
    if (pull.nodes.empty())
      throw std::invalid_argument("the region to pull on " + actor.object.name +
                                  " is held fixed; release it first or choose another");
    actor.soft->forgetCompliance();
  }
  actor.pulls.push_back(pull);
  return actor.object.name + " (" + toString(actor.kind) + ") is pulled " +
         (pull.to_target ? "to a target by " + describe(edit.vector) + " m"
                         : "with " + describe(edit.vector) + " N") +
         " at " + std::to_string(pull.vertices.size()) + " vertices";
}

std::string World::Impl::fix(Actor& actor, const Edit& edit) {
  const std::vector<int> vertices = selectVertices(scene, actor.id, edit.region);
  touch(actor, edit);
  if (!actor.soft)
    throw std::invalid_argument(actor.object.name + " is " + toString(actor.kind) +
                                "; only a deformable object has regions to fix (edit 'kind')");
  actor.soft->body().fixSurfaceVertices(vertices);
  actor.soft->forgetCompliance();
  actor.fixed.push_back(vertices);
  return actor.object.name + " is held at " + std::to_string(vertices.size()) + " vertices";
}

std::string World::Impl::release(Actor& actor, const Edit& edit) {
  const std::vector<int> vertices = selectVertices(scene, actor.id, edit.region);
  touch(actor, edit);
  size_t released = 0;
  const auto meets = [&](const std::vector<int>& region) {
    if (!intersects(region, vertices)) return false;
    if (actor.soft) actor.soft->body().releaseSurfaceVertices(region);
    ++released;
    return true;
  };
  actor.fixed.erase(std::remove_if(actor.fixed.begin(), actor.fixed.end(), meets),
                    actor.fixed.end());
  const auto lets_go = [&](const Pull& pull) {
    if (!intersects(pull.vertices, vertices)) return false;
    if (actor.soft)
      for (const int node : pull.nodes) actor.soft->body().releaseNode(node);
    ++released;
    return true;
  };
  actor.pulls.erase(std::remove_if(actor.pulls.begin(), actor.pulls.end(), lets_go),
                    actor.pulls.end());
  if (released == 0)
    throw std::invalid_argument("nothing is fixed or pulled in that region of " +
                                actor.object.name);
  if (actor.soft) {
    for (const auto& region : actor.fixed) actor.soft->body().fixSurfaceVertices(region);
    actor.soft->forgetCompliance();
  }
  return std::to_string(released) + " region(s) of " + actor.object.name + " are let go";
}

std::string World::Impl::changeMaterial(Actor& actor, const Edit& edit) {
  Material material = actor.material;
  material.youngs_modulus = changed(material.youngs_modulus, edit.youngs_modulus, edit.mode);
  material.density = changed(material.density, edit.density, edit.mode);
  material.poissons_ratio =
      changed(material.poissons_ratio, edit.poissons_ratio, EditMode::kAbsolute);
  material.damping = changed(material.damping, edit.damping, EditMode::kAbsolute);
  validate(material);
  touch(actor, edit);
  actor.material = material;
  if (actor.soft) {
    actor.soft->body().setMaterial(material);
    actor.soft->forgetCompliance();
  }
  if (actor.kind == ObjectKind::kRigid)
    rigid.setMass(*actor.body, massProperties(actor.object.mesh, material.density));
  plan_changed = true;
  std::ostringstream text;
  text << actor.object.name << ": E = " << material.youngs_modulus
       << " Pa, nu = " << material.poissons_ratio << ", density = " << material.density
       << " kg/m^3, damping = " << material.damping << " s";
  return text.str();
}

std::string World::Impl::changeGravity(const Edit& edit) {
  std::string changed_objects;
  for (Actor& actor : actors) {
    if (actor.removed || (!edit.object.empty() && actor.object.name != edit.object)) continue;
    const Eigen::Vector3d gravity =
        edit.mode == EditMode::kFactor ? edit.factor * actor.gravity : edit.vector;
    // A change for the whole scene leaves alone what goes on lying on its support.
    if (edit.object.empty() && !actor.edited) {
      findHolder(actor);
      if (actor.holder == Holder::kSupport && gravity.dot(scene.gravity) > 0.0) {
        actor.gravity = gravity;
        continue;
      }
    }
    touch(actor, edit);
    actor.gravity = gravity;
    if (actor.soft) actor.soft->setGravity(actor.acceleration());
    if (actor.kind == ObjectKind::kRigid) rigid.setAcceleration(*actor.body, actor.acceleration());
    changed_objects += " " + actor.object.name + " " + describe(gravity) + " m/s^2;";
  }
  return changed_objects.empty() ? "gravity changed; every object goes on resting"
                                 : "gravity:" + changed_objects;
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
    const ObservedMotion seen = actor.track.at(now);
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
  } else if (actor.soft) {
    actor.soft->body().setRigidVelocity(linear, angular);
  } else {
    rigid.setVelocity(*actor.body, linear, angular);
  }
  return actor.object.name + " moves with " + describe(linear) + " m/s, " + describe(angular) +
         " rad/s";
}

}  // namespace calipso::fem
