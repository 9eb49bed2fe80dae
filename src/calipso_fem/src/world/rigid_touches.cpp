#include <algorithm>
#include <optional>

#include "rigid_world_impl.hpp"

// What Bullet has found to touch.
namespace calipso::fem {

std::vector<RigidTouch> RigidWorld::touchesAround(std::set<Id> ids) const {
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
  for (const int i : manifolds) {
    const btPersistentManifold* m = dispatcher.getManifoldByIndexInternal(i);
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
