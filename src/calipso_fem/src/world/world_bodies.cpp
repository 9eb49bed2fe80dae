#include <algorithm>
#include <cmath>

#include "describe.hpp"
#include "obstacle_query.hpp"
#include "world_impl.hpp"

// How an object of the video becomes a body, and changes from one kind into another.
namespace calipso::fem {
namespace {

// An object that starts to be simulated must not keep the video waiting.
constexpr int kSettlingLoadSteps = 4;
constexpr double kRunUp = 0.2;  // s, over which one that deforms in the video is led there
// A sheet bears loads where the points of integration of its cells are. Where it passes from one
// layer of cells to the next they step aside with it; in cells ten times as thick as it is such a
// step is seen as a dent.
constexpr double kMostThicknesses = 8.0;

}  // namespace

double pixelsPerMeter(const Camera& camera, const Eigen::Vector3d& at) {
  const double depth = (camera.world_from_camera.inverse() * at).z();
  return depth > 0.0 && camera.fx > 0.0 ? camera.fx / depth : 0.0;
}

TriangleMesh placed(const TriangleMesh& mesh, const Eigen::Isometry3d& pose) {
  TriangleMesh m = mesh;
  m.vertices =
      (mesh.vertices * pose.linear().transpose()).rowwise() + pose.translation().transpose();
  return m;
}

Eigen::Vector3d centerOfMass(const Actor& actor) {
  const TriangleMesh& mesh = actor.object.mesh;
  if (actor.flat) return mesh.vertices.colwise().mean().transpose();
  return massProperties(mesh, 1.0).center;
}

double massOf(const Actor& actor) {
  return actor.soft ? actor.soft->body().totalMass()
                    : massProperties(actor.object.mesh, actor.material.density).mass;
}

FemOptions chooseFem(const TriangleMesh& surface, const Camera& camera, const WorldParams& params,
                     const ObjectSettings& settings) {
  FemOptions options = params.fem;
  options.static_most_load_steps = kSettlingLoadSteps;
  options.target_nodes = params.max_nodes;
  if (settings.cell_size) {
    options.cell_size = *settings.cell_size;
    return options;
  }
  // Displacements of a third of the size, with an error that falls with the square of the cells:
  // error = size / 3 (cell / size)^2.
  const double size = boundingDiagonal(surface);
  const double pixels =
      size * pixelsPerMeter(camera, surface.vertices.colwise().mean().transpose());
  if (pixels <= 0.0) return options;
  const double cells = std::sqrt(pixels / 3.0 / params.pixel_error);
  const double cell = size / std::max(4.0, cells);
  const Eigen::Vector3d extent =
      (surface.vertices.colwise().maxCoeff() - surface.vertices.colwise().minCoeff()).transpose();
  // Thin objects need cells no larger than their thickness; what is too many nodes is left to the
  // search for max_nodes.
  const double volume = std::abs(signedVolume(surface)),
               thickness = std::max(volume / (extent.prod() / extent.minCoeff()), 1e-3 * size),
               nodes = volume / std::pow(cell, 3) * std::pow(1.0 + cell / thickness, 2);
  if (nodes < params.max_nodes) options.cell_size = std::min(cell, kMostThicknesses * thickness);
  return options;
}

Eigen::Isometry3d World::Impl::poseOf(const Actor& actor, double at) const {
  if (actor.soft) return actor.soft->motion() * actor.soft_from_object;
  if (actor.kind == ObjectKind::kRigid && actor.body) return rigid.pose(*actor.body);
  return actor.placement * actor.track.at(at).world_from_object;
}

BodyMotion World::Impl::motionOf(const Actor& actor) const {
  BodyMotion m;
  m.world_from_object = poseOf(actor, now);
  if (actor.soft) {
    const Momentum p = actor.soft->body().momentum();
    const Eigen::VectorXd& mass = actor.soft->body().model().lumpedMass();
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    for (int i = 0; i < mass.size(); ++i) {
      const Eigen::Vector3d r = actor.soft->body().positions().segment<3>(3 * i) - p.center;
      inertia += mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
    }
    m.linear = p.linear / mass.sum();
    m.angular = inertia.ldlt().solve(p.angular);
  } else if (actor.kind == ObjectKind::kRigid && actor.body) {
    m.linear = rigid.linearVelocity(*actor.body);
    m.angular = rigid.angularVelocity(*actor.body);
  } else if (actor.track.at(now).moving) {
    const BodyMotion seen = seenMotionOf(actor);
    m.linear = actor.placement.linear() * seen.linear;
    m.angular = actor.placement.linear() * seen.angular;
  }
  return m;
}

// The video tells the velocity of another point than the centre of mass.
BodyMotion World::Impl::seenMotionOf(const Actor& actor) const {
  const ObservedMotion seen = actor.track.at(now);
  const Eigen::Vector3d center = seen.world_from_object * centerOfMass(actor);
  return {seen.world_from_object, seen.linear + seen.angular.cross(center - seen.centroid),
          seen.angular};
}

decltype(TriangleMesh::vertices) World::Impl::verticesOf(const Actor& actor) const {
  if (actor.soft) return actor.soft->vertices();
  if (actor.kind == ObjectKind::kRigid || actor.modes.cols() == 0)
    return placed(actor.object.mesh, poseOf(actor, now)).vertices;
  // What the video deforms goes on doing so until it is simulated: from its shape and place in the
  // key frame.
  TriangleMesh shape = actor.object.mesh;
  const Eigen::VectorXd amplitudes = actor.track.at(now).mode_amplitudes;
  if (amplitudes.size() == actor.modes.cols()) {
    const Eigen::VectorXd field = actor.scale * (actor.modes * amplitudes);
    shape.vertices +=
        Eigen::Map<const Eigen::Matrix3Xd>(field.data(), 3, field.size() / 3).transpose();
  }
  return placed(shape, actor.placement * actor.object.world_from_object).vertices;
}

Eigen::Vector3d World::Impl::centroidOf(const Actor& actor) const {
  return verticesOf(actor).colwise().mean().transpose();
}

void World::Impl::become(Actor& actor, ObjectKind kind, const std::string& reason) {
  if (kind != ObjectKind::kStatic && actor.followsVideo()) findHolder(actor);
  // What is attached does not move as a whole.
  const bool attached = kind == ObjectKind::kRigid && actor.holder == Holder::kAttachment;
  const bool immovable =
      actor.immovable && (kind == ObjectKind::kRigid || kind == ObjectKind::kDeformable);
  if (attached || immovable) kind = ObjectKind::kKinematic;
  if (kind == ObjectKind::kStatic && !actor.edited) actor.reason = reason, plan_changed = true;
  if (actor.kind == kind) return;
  BodyMotion motion = motionOf(actor);
  const bool as_observed = actor.kind == ObjectKind::kStatic;
  Eigen::Isometry3d seen = actor.track.at(now).world_from_object;
  const bool deforms = !actor.simulated() && kind == ObjectKind::kDeformable &&
                       actor.modes.cols() > 0 && !actor.track.empty();
  if (deforms) motion = keyPlaceOf(actor), seen = actor.object.world_from_object;
  Body body = bodyOf(actor, actor.object.mesh, kind, motion);
  actor.edited = actor.edited || kind != ObjectKind::kStatic;
  actor.reason = reason + (immovable  ? "; its mass is infinite"
                           : attached ? "; its attachments hold it in place"
                                      : "");
  actor.placement = motion.world_from_object * seen.inverse();
  enter(actor, std::move(body), as_observed);
  if (deforms) deformAsObserved(actor);
}

World::Impl::Body World::Impl::bodyOf(const Actor& actor, const TriangleMesh& mesh, ObjectKind kind,
                                      const BodyMotion& motion) {
  Body body{kind, motion, {}, nullptr};
  if (kind == ObjectKind::kRigid) {
    RigidBodySpec& spec = body.rigid;
    spec.name = actor.object.name;
    spec.shapes = hulls.of(mesh);
    spec.mass = massProperties(mesh, actor.material.density);
    spec.surface = actor.settings.surface;
    spec.world_from_object = motion.world_from_object;
    spec.linear = motion.linear;
    spec.angular = motion.angular;
    spec.asleep =
        actor.holder == Holder::kSupport && motion.linear.isZero() && motion.angular.isZero();
  } else if (kind == ObjectKind::kDeformable) {
    const TriangleMesh surface = placed(mesh, motion.world_from_object);
    body.soft = std::make_unique<SoftObject>(
        surface, actor.observed_material, chooseFem(surface, scene.camera, params, actor.settings));
  }
  return body;
}

void World::Impl::enter(Actor& actor, Body body, bool settle) {
  removeBodies(actor);
  actor.kind = body.kind;
  if (body.kind == ObjectKind::kRigid)
    makeRigid(actor, body.rigid);
  else if (body.kind == ObjectKind::kDeformable)
    makeSoft(actor, std::move(body), settle);
  else
    addCollider(actor);
  plan_changed = true;
}

// Which others a surface of the object is in, and how deep: "2 mm inside table".
std::vector<std::string> World::Impl::overlapsOf(const Actor& actor, const TriangleMesh& surface) {
  constexpr double kNoted = 2e-3;  // of its size: alignment leaves as much
  const double size = boundingDiagonal(surface);
  std::vector<std::string> found;
  for (const Obstacle& obstacle : obstacles(now, now, &actor)) {
    if (!meet(actor.id, obstacle.id)) continue;
    if (!obstacle.plane &&
        !obstacleBounds(obstacle).intersects({surface.vertices.colwise().minCoeff().transpose(),
                                              surface.vertices.colwise().maxCoeff().transpose()}))
      continue;
    double deepest = 0.0;
    for (int v = 0; v < surface.vertexCount(); ++v)
      if (const auto hit = queryObstacle(obstacle, surface.vertex(v), 0.0, size))
        deepest = std::max(deepest, -hit->gap);
    if (deepest > kNoted * size)
      found.push_back(describeLength(deepest) + " inside " + obstacle.name);
  }
  return found;
}

// Contacts push these apart slowly.
void World::Impl::noteOverlaps(Actor& actor, const TriangleMesh& surface) {
  for (const std::string& overlap : overlapsOf(actor, surface))
    actor.note += "starts " + overlap + ", is pushed out slowly; ";
}

void World::Impl::makeRigid(Actor& actor, const RigidBodySpec& spec) {
  addColliders();
  actor.note = spec.mass.note.empty() ? "" : spec.mass.note + "; ";
  meetOwnSupports(actor, false);
  noteOverlaps(actor, placed(actor.object.mesh, spec.world_from_object));
  actor.body = rigid.add(spec);
  rigid.setAcceleration(*actor.body, actor.acceleration());
  applyRules(actor);
}

void World::Impl::makeSoft(Actor& actor, Body made, bool settle) {
  const BodyMotion& motion = made.motion;
  const TriangleMesh surface = placed(actor.object.mesh, motion.world_from_object);
  actor.soft = std::move(made.soft);
  actor.soft_from_object = motion.world_from_object;
  DeformableBody& body = actor.soft->body();
  for (const std::string& message : body.grid().messages) actor.note += message + "; ";
  meetOwnSupports(actor, false);
  noteOverlaps(actor, surface);
  if (actor.holder == Holder::kAttachment && actor.fixed.empty())
    actor.fixed.push_back(attachedOf(actor));
  holdAnew(actor);
  body.setPressure(actor.pressure);
  actor.soft->setGravity(actor.acceleration());
  const std::vector<Obstacle> around = obstacles(now, now, &actor);
  const Touching support = settle ? supportPoints(actor, surface, around) : Touching();
  limitSag(actor, surface, pointsOf(support));
  if (settle) settleAsObserved(actor, surface, around, support);
  actor.soft->setMaterial(actor.material);
  if (!motion.linear.isZero() || !motion.angular.isZero())
    body.setRigidVelocity(motion.linear, motion.angular);
  actor.soft->changed();
  watchItself(actor);
  actor.asleep = false;
  actor.calm_frames = 0;
}

BodyMotion World::Impl::keyPlaceOf(const Actor& actor) const {
  BodyMotion motion;
  motion.world_from_object = actor.placement * actor.object.world_from_object;
  return motion;
}

// The field sum_m a_m phi_m of the video's deformation as the nodes move, world axes.
Vec World::Impl::nodalModes(const Actor& actor, const Vec& amplitudes) const {
  Vec field = actor.scale * (actor.modes * amplitudes);
  Eigen::Map<Eigen::Matrix3Xd> columns(field.data(), 3, field.size() / 3);
  columns = (actor.soft_from_object.linear() * columns).eval();
  return actor.soft->nodalField(field);
}

// Its modes tell a shape that the material may resist, as by being stretched: led along the motion
// for a while, it is in one of its own when it is let go.
void World::Impl::deformAsObserved(Actor& actor) {
  const double step = params.frame_period / params.max_substeps;
  const int steps = static_cast<int>(std::min(kRunUp, now - actor.track.begin()) / step);
  const ObservedMotion seen = actor.track.at(now - steps * step);
  if (seen.mode_amplitudes.size() != actor.modes.cols()) return;
  DeformableBody& body = actor.soft->body();
  const Vec key = body.positions();
  body.setState(key + nodalModes(actor, seen.mode_amplitudes),
                nodalModes(actor, seen.mode_velocities));
  auto twin = twinOf(actor, actor.object.mesh, ObservedDrive::twinOptions(body.options()));
  for (const auto& region : actor.fixed) twin->body().fixSurfaceVertices(region);
  actor.drive = std::make_unique<ObservedDrive>(std::move(twin));
  actor.key_nodes = key;
  for (int k = steps - 1; k >= 0; --k) driveTo(actor, now - k * step, speed_scale * step);
  if (actor.drive->holds()) {
    const DeformableBody& led = actor.drive->twin().body();
    body.setState(led.positions(), led.velocities());
  } else {
    const ObservedMotion start = actor.track.at(now);
    body.setState(key + nodalModes(actor, start.mode_amplitudes),
                  nodalModes(actor, start.mode_velocities));
    endDrive(actor);
    noteNoDrive(actor);
  }
  actor.soft->changed();
}

void World::Impl::removeBodies(Actor& actor) {
  wakeAround(actor);
  if (actor.body) rigid.remove(*actor.body);
  for (Pull& pull : actor.pulls) pull.nodes.clear();
  actor.body.reset();
  actor.soft.reset();
  actor.drive.reset();
  actor.sheet.reset();
  contacts.forget(actor.id);
}

void World::Impl::reset(Actor& actor) {
  const int id = actor.id;
  removeBodies(actor);
  meetOwnSupports(actor, true);
  restoreRules(actor.object.name);
  keepOwnSupportsOut();
  if (actor.inserted) {  // the video does not have it
    actor.removed = actor.edited = true;
    actor.kind = ObjectKind::kStatic;
    plan_changed = true;
    return;
  }
  Actor fresh(scene.objects[id]);
  fresh.id = id;
  fresh.track = actor.track;
  fresh.own_supports = actor.own_supports;
  fresh.wind = actor.wind;
  fresh.collisions = actor.collisions;
  fresh.modes = actor.modes;
  fresh.settings = params.settingsOf(fresh.object.name);
  fresh.immovable = fresh.settings.immovable();
  fresh.observed_material = fresh.material =
      observedMaterial(fresh.object, fresh.settings, scene.gravity);
  fresh.gravity = gravity_now;
  actor = std::move(fresh);
  addCollider(actor);
  plan_changed = true;
}

// Bullet gets the supports and the objects at rest with the first rigid body, not before. What
// moves is made of convex parts; what is flat is its own.
void World::Impl::addColliders() {
  if (has_colliders) return;
  has_colliders = true;
  for (const SupportPlane& plane : scene.planes)
    supports.push_back(rigid.addPlane(plane, params.support));
  for (const SupportMesh& mesh : scene.support_meshes) {
    RigidBodySpec spec;
    spec.name = mesh.name;
    spec.shapes = {mesh.mesh};
    spec.motion = RigidMotion::kStatic;
    spec.surface = params.support;
    supports.push_back(rigid.add(spec));
  }
  for (Actor& actor : actors) addCollider(actor);
}

void World::Impl::addCollider(Actor& actor) {
  if (!has_colliders || actor.removed || actor.body || actor.simulated()) return;
  RigidBodySpec spec;
  spec.name = actor.object.name;
  spec.surface = actor.settings.surface;
  spec.world_from_object = poseOf(actor, now);
  const bool moves = !actor.track.empty() || actor.kind == ObjectKind::kKinematic;
  spec.motion = moves ? RigidMotion::kKinematic : RigidMotion::kStatic;
  if (moves && !actor.flat)
    spec.shapes = hulls.of(actor.object.mesh);
  else
    spec.shapes = {actor.object.mesh};
  actor.body = rigid.add(spec);
  applyRules(actor);
}

void World::Impl::wake(Actor& actor) {
  actor.asleep = false;
  actor.calm_frames = 0;
  if (actor.kind == ObjectKind::kRigid && actor.body) rigid.wake(*actor.body);
}

bool World::Impl::sleeps(const Actor& actor) const {
  if (actor.soft) return actor.asleep;
  return actor.kind == ObjectKind::kRigid && actor.body && rigid.sleeping(*actor.body);
}

}  // namespace calipso::fem
