#include <algorithm>
#include <optional>

#include "rigid_world_impl.hpp"

// What Bullet has found to touch, and what is about to.
namespace calipso::fem {
namespace {

bool isPlane(const btCollisionObject* o) {
  return o->getCollisionShape()->getShapeType() == STATIC_PLANE_PROXYTYPE;
}

// Hulls of a body: the parts of a compound (they lie in the body's frame), or the only one.
std::vector<const btConvexHullShape*> hullsOf(const btRigidBody& body) {
  const btCollisionShape* shape = body.getCollisionShape();
  std::vector<const btConvexHullShape*> hulls;
  if (!shape->isCompound()) return {static_cast<const btConvexHullShape*>(shape)};
  const auto* compound = static_cast<const btCompoundShape*>(shape);
  for (int i = 0; i < compound->getNumChildShapes(); ++i)
    hulls.push_back(static_cast<const btConvexHullShape*>(compound->getChildShape(i)));
  return hulls;
}

// How far a body's points may go in h, m.
double travelOf(const btRigidBody& body, double h) {
  btVector3 center;
  btScalar radius = 0.0;
  body.getCollisionShape()->getBoundingSphere(center, radius);
  return h * (body.getLinearVelocity().length() + h * body.getGravity().length() +
              (center.length() + radius) * body.getAngularVelocity().length());
}

}  // namespace

void RigidWorld::Impl::addPlaneTouches(Id id, double reach, std::vector<RigidTouch>& found) const {
  const btRigidBody& body = *at(id).body;
  for (const auto& [other, plane] : bodies) {
    if (!isPlane(plane.body.get()) || filter.excluded.count(std::minmax({id, other}))) continue;
    const auto& ground = static_cast<const btStaticPlaneShape&>(*plane.body->getCollisionShape());
    const btTransform& world_from_plane = plane.body->getWorldTransform();
    const btTransform plane_from_body = world_from_plane.inverseTimes(body.getWorldTransform());
    const btVector3 up = world_from_plane.getBasis() * ground.getPlaneNormal();
    for (const btConvexHullShape* hull : hullsOf(body))
      for (const PlaneCorner& c : spanningCorners(*hull, plane_from_body, ground, reach)) {
        const btVector3 place = world_from_plane * c.point - (c.height + hull->getMargin()) * up;
        found.push_back({id, std::nullopt, fromBullet(place), fromBullet(up),
                         std::max(0.0, c.height), world.frictionOf(body, *plane.body)});
      }
  }
}

std::vector<RigidTouch> RigidWorld::touchesAround(std::set<Id> ids, double reach, double h) const {
  auto& dispatcher = impl_->dispatcher;
  const auto dynamic = [&](const btCollisionObject* o) {
    return BulletWorld::isDynamic(o) ? std::optional<Id>(o->getUserIndex()) : std::nullopt;
  };
  std::set<int> manifolds;
  for (bool grows = true; grows;) {
    grows = false;
    for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
      const btPersistentManifold* m = dispatcher.getManifoldByIndexInternal(i);
      const auto a = dynamic(m->getBody0()), b = dynamic(m->getBody1());
      if (m->getNumContacts() == 0 || manifolds.count(i)) continue;
      if (!(a && ids.count(*a)) && !(b && ids.count(*b))) continue;
      manifolds.insert(i);
      for (const auto& id : {a, b})
        if (id) ids.insert(*id);
      grows = true;
    }
  }
  std::vector<RigidTouch> touches;
  for (const Id id : ids)
    impl_->addPlaneTouches(id, reach + travelOf(*impl_->at(id).body, h), touches);
  for (const int i : manifolds) {
    const btPersistentManifold* m = dispatcher.getManifoldByIndexInternal(i);
    if (isPlane(m->getBody0()) || isPlane(m->getBody1())) continue;
    for (int k = 0; k < m->getNumContacts(); ++k) {
      const btManifoldPoint& p = m->getContactPoint(k);
      if (p.getDistance() > BulletWorld::kIgnoredBeyond) continue;
      touches.push_back({dynamic(m->getBody0()), dynamic(m->getBody1()),
                         fromBullet(p.getPositionWorldOnB()), fromBullet(p.m_normalWorldOnB),
                         std::max(0.0, p.getDistance()), p.m_combinedFriction});
    }
  }
  return touches;
}

const std::vector<TouchEvent>& RigidWorld::touches() const { return impl_->touches; }

std::vector<ContactPoint> RigidWorld::contacts() const {
  std::vector<ContactPoint> contacts;
  const auto& dispatcher = impl_->dispatcher;
  for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
    const btPersistentManifold* manifold =
        const_cast<btCollisionDispatcher&>(dispatcher).getManifoldByIndexInternal(i);
    for (int k = 0; k < manifold->getNumContacts(); ++k) {
      const btManifoldPoint& p = manifold->getContactPoint(k);
      if (p.m_appliedImpulse <= 0.0) continue;
      ContactPoint c;
      c.a = impl_->at(manifold->getBody0()->getUserIndex()).name;
      c.b = impl_->at(manifold->getBody1()->getUserIndex()).name;
      c.position = fromBullet(p.getPositionWorldOnB());
      c.normal = fromBullet(p.m_normalWorldOnB);
      c.force = fromBullet(p.m_appliedImpulse * p.m_normalWorldOnB +
                           p.m_appliedImpulseLateral1 * p.m_lateralFrictionDir1 +
                           p.m_appliedImpulseLateral2 * p.m_lateralFrictionDir2) /
                impl_->substep;
      c.depth = -p.getDistance();
      contacts.push_back(c);
    }
  }
  return contacts;
}

}  // namespace calipso::fem
