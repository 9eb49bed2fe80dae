#include "calipso_fem/world/rigid_world.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "mesh_shape.hpp"
#include "rigid_world_impl.hpp"

namespace calipso::fem {
namespace {

Eigen::Matrix3d cross(const Eigen::Vector3d& r) {
  Eigen::Matrix3d m;
  m << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return m;
}

void validate(const RigidBodySpec& spec) {
  if (spec.shapes.empty() || spec.shapes.front().triangleCount() == 0)
    throw std::invalid_argument(spec.name + ": a body needs a collision shape; its mesh is empty");
  if (spec.motion == RigidMotion::kDynamic && !(spec.mass.mass > 0.0))
    throw std::invalid_argument(spec.name + ": mass = " + std::to_string(spec.mass.mass) +
                                " kg; must be positive (infinite: nothing moves it)");
  validate(spec.surface, spec.name);
}

// Bullet multiplies the two surfaces' values; roots make that the geometric mean.
void applySurface(btRigidBody& body, const SurfaceSettings& surface) {
  body.setFriction(std::sqrt(surface.friction));
  body.setRestitution(std::sqrt(surface.restitution));
  body.setRollingFriction(surface.rolling_friction);
}

}  // namespace

RigidWorld::RigidWorld() : impl_(std::make_unique<Impl>()) {}
RigidWorld::~RigidWorld() = default;

RigidWorld::Id RigidWorld::add(const RigidBodySpec& spec) {
  validate(spec);
  if (spec.motion == RigidMotion::kDynamic && std::isinf(spec.mass.mass)) {
    RigidBodySpec immovable = spec;
    immovable.motion = RigidMotion::kStatic;
    return add(immovable);
  }
  BulletBody body;
  body.name = spec.name;
  body.motion = spec.motion;
  body.kinematic_start = body.kinematic_target = spec.world_from_object;
  btVector3 inertia(0, 0, 0);
  const bool dynamic = spec.motion == RigidMotion::kDynamic;
  if (dynamic) inertia = toBullet(principal(spec.mass, body.object_from_body));
  buildShape(body, spec);
  btRigidBody::btRigidBodyConstructionInfo info(dynamic ? spec.mass.mass : 0.0, nullptr,
                                                body.shapes.back().get(), inertia);
  info.m_startWorldTransform = toBullet(spec.world_from_object * body.object_from_body);
  body.body = std::make_unique<btRigidBody>(info);
  applySurface(*body.body, spec.surface);
  if (body.triangles) MeshShape::adjustContactsOf(*body.body);
  if (spec.motion == RigidMotion::kKinematic) {
    body.body->setCollisionFlags(body.body->getCollisionFlags() |
                                 btCollisionObject::CF_KINEMATIC_OBJECT);
    body.body->setActivationState(DISABLE_DEACTIVATION);
  }
  if (dynamic) {
    const double size = span(spec.shapes);
    const double slow = 0.01 * std::sqrt(9.81 * size);  // a hundredth of falling by its own size
    body.body->setSleepingThresholds(slow, slow / size);
    body.body->setCcdMotionThreshold(0.2 * size);
    body.body->setCcdSweptSphereRadius(0.1 * size);
    body.body->setFlags(body.body->getFlags() | BT_ENABLE_GYROSCOPIC_FORCE_IMPLICIT_BODY);
    body.body->setLinearVelocity(toBullet(spec.linear));
    body.body->setAngularVelocity(toBullet(spec.angular));
  }
  const Id id = impl_->enter(std::move(body));
  if (dynamic) impl_->world.forgiveOverlapOf(id);
  if (spec.asleep) impl_->at(id).body->forceActivationState(ISLAND_SLEEPING);
  return id;
}

RigidWorld::Id RigidWorld::addPlane(const SupportPlane& plane, const SurfaceSettings& surface) {
  BulletBody body;
  body.name = plane.name;
  if (plane.x_range) {
    buildStrip(body, plane);
  } else {
    body.shapes.push_back(
        std::make_unique<btStaticPlaneShape>(toBullet(plane.normal), plane.offset));
    body.shapes.back()->setMargin(0.0);
    body.body = std::make_unique<btRigidBody>(
        btRigidBody::btRigidBodyConstructionInfo(0.0, nullptr, body.shapes.back().get()));
  }
  applySurface(*body.body, surface);
  return impl_->enter(std::move(body));
}

void RigidWorld::remove(Id id) {
  BulletBody& b = impl_->at(id);
  impl_->world.forget(id);
  impl_->world.removeRigidBody(b.body.get());
  impl_->bodies.erase(id);
}

void RigidWorld::setRule(Id a, Id b, const PairRule& rule) {
  const BulletWorld::Pair pair = std::minmax({a, b});
  impl_->world.setPairSurface(pair, rule.friction, rule.restitution);
  const bool excluded = impl_->filter.excluded.count(pair) > 0;
  if (excluded == !rule.contact) return;
  btRigidBody &body_a = *impl_->at(a).body, &body_b = *impl_->at(b).body;
  if (rule.contact) {
    impl_->filter.excluded.erase(pair);
    for (btRigidBody* body : {&body_a, &body_b})  // a renewed proxy finds its pairs again
      impl_->world.refreshBroadphaseProxy(body);
    for (const Id id : {a, b})
      if (BulletWorld::isDynamic(impl_->at(id).body.get())) impl_->world.forgiveOverlapOf(id);
  } else {
    impl_->filter.excluded.insert(pair);
    impl_->world.getPairCache()->removeOverlappingPair(
        body_a.getBroadphaseProxy(), body_b.getBroadphaseProxy(), &impl_->dispatcher);
  }
  for (btRigidBody* body : {&body_a, &body_b})  // what lay on the other may fall
    if (BulletWorld::isDynamic(body)) body->activate();
}

void RigidWorld::setSurface(Id id, const SurfaceSettings& surface) {
  BulletBody& b = impl_->at(id);
  validate(surface, b.name);
  applySurface(*b.body, surface);
  if (b.motion == RigidMotion::kDynamic) b.body->activate();
}

void RigidWorld::setPose(Id id, const Eigen::Isometry3d& world_from_object) {
  BulletBody& b = impl_->at(id);
  b.body->setCenterOfMassTransform(toBullet(world_from_object * b.object_from_body));
  b.body->setInterpolationWorldTransform(b.body->getCenterOfMassTransform());
  b.kinematic_start = b.kinematic_target = world_from_object;
  impl_->world.forget(id);
  if (b.motion == RigidMotion::kDynamic) impl_->world.forgiveOverlapOf(id);
  b.body->activate(true);
}

void RigidWorld::moveKinematic(Id id, const Eigen::Isometry3d& world_from_object) {
  BulletBody& b = impl_->at(id);
  b.kinematic_target = world_from_object;
  b.moves = !world_from_object.isApprox(b.kinematic_start, 0.0);
}

void RigidWorld::setVelocity(Id id, const Eigen::Vector3d& linear, const Eigen::Vector3d& angular) {
  btRigidBody& body = *impl_->at(id).body;
  body.setLinearVelocity(toBullet(linear));
  body.setAngularVelocity(toBullet(angular));
  body.activate(true);
}

void RigidWorld::setMass(Id id, const MassProperties& mass) {
  BulletBody& b = impl_->at(id);
  Eigen::Isometry3d axes = Eigen::Isometry3d::Identity();
  b.body->setMassProps(mass.mass, toBullet(principal(mass, axes)));
  b.body->updateInertiaTensor();
  b.body->activate(true);
}

void RigidWorld::setAcceleration(Id id, const Eigen::Vector3d& acceleration) {
  btRigidBody& body = *impl_->at(id).body;
  if (fromBullet(body.getGravity()) == acceleration) return;
  body.setGravity(toBullet(acceleration));
}

void RigidWorld::setForce(Id id, const Eigen::Vector3d& force, const Eigen::Vector3d& torque) {
  BulletBody& b = impl_->at(id);
  b.force = force;
  b.torque = torque;
  if (!force.isZero() || !torque.isZero()) b.body->activate(true);
}

void RigidWorld::applyImpulse(Id id, const Eigen::Vector3d& impulse, const Eigen::Vector3d& point) {
  btRigidBody& body = *impl_->at(id).body;
  body.applyImpulse(toBullet(impulse), toBullet(point) - body.getCenterOfMassPosition());
  body.activate(true);
}

void RigidWorld::push(Id id, const Eigen::Vector3d& impulse, const Eigen::Vector3d& point) {
  applyImpulse(id, impulse, point);
  impl_->at(id).pushed = true;
}

void RigidWorld::wake(Id id) { impl_->at(id).body->activate(true); }

Eigen::Isometry3d RigidWorld::pose(Id id) const {
  const BulletBody& b = impl_->at(id);
  return fromBullet(b.body->getCenterOfMassTransform()) * b.object_from_body.inverse();
}

Eigen::Vector3d RigidWorld::center(Id id) const {
  return fromBullet(impl_->at(id).body->getCenterOfMassPosition());
}

Eigen::Vector3d RigidWorld::linearVelocity(Id id) const {
  return fromBullet(impl_->at(id).body->getLinearVelocity());
}

Eigen::Vector3d RigidWorld::angularVelocity(Id id) const {
  return fromBullet(impl_->at(id).body->getAngularVelocity());
}

Eigen::Matrix3d RigidWorld::compliance(Id id, const Eigen::Vector3d& at,
                                       const Eigen::Vector3d& from) const {
  const btRigidBody& body = *impl_->at(id).body;
  if (!BulletWorld::isDynamic(&body)) return Eigen::Matrix3d::Zero();
  const btMatrix3x3& I = body.getInvInertiaTensorWorld();
  Eigen::Matrix3d inverse_inertia;
  for (int i = 0; i < 3; ++i) inverse_inertia.row(i) = fromBullet(I[i]).transpose();
  const Eigen::Vector3d center = fromBullet(body.getCenterOfMassPosition());
  return body.getInvMass() * Eigen::Matrix3d::Identity() -
         cross(at - center) * inverse_inertia * cross(from - center);
}

Eigen::Matrix3d RigidWorld::inertia(Id id) const {
  const btRigidBody& body = *impl_->at(id).body;
  if (!BulletWorld::isDynamic(&body)) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d axes = fromBullet(body.getWorldTransform()).linear();
  const Eigen::Vector3d inverse = fromBullet(body.getInvInertiaDiagLocal());
  return axes * inverse.cwiseInverse().asDiagonal() * axes.transpose();
}

std::pair<Eigen::Vector3d, Eigen::Vector3d> RigidWorld::velocityChange(
    Id id, const Eigen::Vector3d& impulse, const Eigen::Vector3d& point) const {
  const btRigidBody& body = *impl_->at(id).body;
  const btVector3 moment =
      (toBullet(point) - body.getCenterOfMassPosition()).cross(toBullet(impulse));
  return {body.getInvMass() * impulse, fromBullet(body.getInvInertiaTensorWorld() * moment)};
}

double RigidWorld::kineticEnergy(Id id) const {
  const btRigidBody& body = *impl_->at(id).body;
  if (body.getInvMass() == 0.0) return 0.0;
  const btVector3 w = body.getWorldTransform().getBasis().transpose() * body.getAngularVelocity();
  const btVector3 inverse = body.getInvInertiaDiagLocal();
  double energy = 0.5 * body.getLinearVelocity().length2() / body.getInvMass();
  for (int k = 0; k < 3; ++k)
    if (inverse[k] > 0.0) energy += 0.5 * w[k] * w[k] / inverse[k];
  return energy;
}

bool RigidWorld::sleeping(Id id) const { return !impl_->at(id).body->isActive(); }

int RigidWorld::awakeCount() const {
  return static_cast<int>(
      std::count_if(impl_->bodies.begin(), impl_->bodies.end(), [](const auto& b) {
        return b.second.motion == RigidMotion::kDynamic && b.second.body->isActive();
      }));
}

namespace {

// Rate of the sub-steps: as fine as a video's frame rate allows for what is awake, 1/s.
double substepRate(int awake) {
  return awake <= 4 ? 1920.0 : awake <= 16 ? 960.0 : awake <= 32 ? 240.0 : 120.0;
}

Eigen::Isometry3d between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double s) {
  Eigen::Isometry3d p = b;
  p.linear() =
      Eigen::Quaterniond(a.linear()).slerp(s, Eigen::Quaterniond(b.linear())).toRotationMatrix();
  p.translation() = (1.0 - s) * a.translation() + s * b.translation();
  return p;
}

}  // namespace

int RigidWorld::step(double h) {
  impl_->touches.clear();
  const int awake = awakeCount();
  const bool pushed = std::any_of(impl_->bodies.begin(), impl_->bodies.end(),
                                  [](const auto& b) { return b.second.moves; });
  if (awake == 0 && !pushed) return 0;  // whatever rests costs nothing
  const int steps = std::max(1, static_cast<int>(std::ceil(h * substepRate(awake) - 1e-9)));
  impl_->substep = h / steps;
  const std::vector<std::pair<btRigidBody*, btVector3>> weightless = impl_->takeWeights(h);
  for (int k = 1; k <= steps; ++k) {
    for (auto& [id, b] : impl_->bodies) {
      if (b.moves)
        b.body->setCenterOfMassTransform(toBullet(
            between(b.kinematic_start, b.kinematic_target, static_cast<double>(k) / steps) *
            b.object_from_body));
      if (b.force.isZero() && b.torque.isZero()) continue;
      b.body->applyCentralForce(toBullet(b.force));
      b.body->applyTorque(toBullet(b.torque));
    }
    impl_->world.substep(impl_->substep);
    for (const BulletWorld::Touch& t : impl_->world.newTouches())
      impl_->touches.push_back({impl_->at(t.a).name, impl_->at(t.b).name, k * impl_->substep,
                                fromBullet(t.position), fromBullet(t.normal), t.approach_speed});
  }
  for (const auto& [body, acceleration] : weightless) body->setGravity(acceleration);
  for (auto& [id, b] : impl_->bodies) {
    b.kinematic_start = b.kinematic_target;
    b.moves = false;
  }
  return steps;
}

}  // namespace calipso::fem
