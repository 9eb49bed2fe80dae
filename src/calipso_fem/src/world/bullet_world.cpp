#include "bullet_world.hpp"

#include <algorithm>

#include "manifold_reduction.hpp"

namespace calipso::fem {
namespace {

btVector3 velocityAt(const btCollisionObject* object, const btVector3& point) {
  const btRigidBody* body = btRigidBody::upcast(object);
  return body ? body->getVelocityInLocalPoint(point - body->getCenterOfMassPosition())
              : btVector3(0, 0, 0);
}

double deepest(const btPersistentManifold& manifold) {
  double depth = 0.0;
  for (int k = 0; k < manifold.getNumContacts(); ++k)
    depth = std::max(depth, -manifold.getContactPoint(k).getDistance());
  return depth;
}

}  // namespace

btTransform toBullet(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d& R = pose.linear();
  return btTransform(
      btMatrix3x3(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)),
      toBullet(Eigen::Vector3d(pose.translation())));
}

Eigen::Isometry3d fromBullet(const btTransform& pose) {
  const btQuaternion q = pose.getRotation();
  Eigen::Isometry3d p = Eigen::Isometry3d::Identity();
  p.linear() = Eigen::Quaterniond(q.w(), q.x(), q.y(), q.z()).normalized().toRotationMatrix();
  p.translation() = fromBullet(pose.getOrigin());
  return p;
}

BulletWorld::Pair BulletWorld::pairOf(const btPersistentManifold& manifold) {
  return std::minmax({manifold.getBody0()->getUserIndex(), manifold.getBody1()->getUserIndex()});
}

bool BulletWorld::isDynamic(const btCollisionObject* object) {
  return !object->isStaticOrKinematicObject();
}

void BulletWorld::forgiveOverlapOf(int id) {
  performDiscreteCollisionDetection();
  std::map<Pair, double> depth;
  for (int i = 0; i < getDispatcher()->getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *getDispatcher()->getManifoldByIndexInternal(i);
    const Pair pair = pairOf(manifold);
    if (pair.first == id || pair.second == id)
      depth[pair] = std::max(depth[pair], deepest(manifold));
  }
  for (const auto& [pair, d] : depth)
    if (d > 0.0) forgiven_[pair] = d;
}

void BulletWorld::forget(int id) {
  const auto concerns = [&](const Pair& pair) { return pair.first == id || pair.second == id; };
  for (auto it = touching_.begin(); it != touching_.end();)
    it = concerns(*it) ? touching_.erase(it) : std::next(it);
  for (auto it = forgiven_.begin(); it != forgiven_.end();)
    it = concerns(it->first) ? forgiven_.erase(it) : std::next(it);
}

void BulletWorld::adjust(btManifoldPoint& point, const btPersistentManifold& manifold, double h,
                         double forgiven) {
  point.setDistance(point.getDistance() + forgiven);
  const Pair pair = pairOf(manifold);
  const auto surface = pair_surface_.find(pair);
  if (surface != pair_surface_.end()) {
    if (surface->second.friction) point.m_combinedFriction = *surface->second.friction;
    if (surface->second.restitution) point.m_combinedRestitution = *surface->second.restitution;
  }
  const double closing =
      point.m_normalWorldOnB.dot(velocityAt(manifold.getBody1(), point.getPositionWorldOnB()) -
                                 velocityAt(manifold.getBody0(), point.getPositionWorldOnA()));
  double& fastest = closing_[pair];
  fastest = std::max(fastest, closing);
  if (point.m_combinedRestitution <= 0.0 || point.getDistance() <= 0.0) return;
  if (closing < getSolverInfo().m_restitutionVelocityThreshold) return;
  const bool meet = point.getDistance() <= closing * h;
  point.setDistance(meet ? 0.0 : 1e3 * closing * h);
}

std::vector<btManifoldPoint*> BulletWorld::redundantContacts() {
  std::vector<std::pair<Pair, btPersistentManifold*>> manifolds;
  for (int i = 0; i < getDispatcher()->getNumManifolds(); ++i) {
    btPersistentManifold* manifold = getDispatcher()->getManifoldByIndexInternal(i);
    if (manifold->getNumContacts() > 0) manifolds.emplace_back(pairOf(*manifold), manifold);
  }
  std::stable_sort(manifolds.begin(), manifolds.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<btManifoldPoint*> redundant, contacts;
  for (auto it = manifolds.begin(); it != manifolds.end();) {
    contacts.clear();
    for (const Pair pair = it->first; it != manifolds.end() && it->first == pair; ++it)
      for (int k = 0; k < it->second->getNumContacts(); ++k)
        contacts.push_back(&it->second->getContactPoint(k));
    for (btManifoldPoint* point : fem::redundantContacts(contacts)) redundant.push_back(point);
  }
  return redundant;
}

void BulletWorld::solveConstraints(btContactSolverInfo& info) {
  std::map<Pair, double> depth;
  closing_.clear();
  const std::vector<btManifoldPoint*> redundant = redundantContacts();
  for (int i = 0; i < getDispatcher()->getNumManifolds(); ++i) {
    btPersistentManifold& manifold = *getDispatcher()->getManifoldByIndexInternal(i);
    const auto found = forgiven_.find(pairOf(manifold));
    double forgiven = 0.0;
    if (found != forgiven_.end()) {
      forgiven = found->second;
      double& d = depth[found->first];
      d = std::max(d, deepest(manifold));
    }
    for (int k = 0; k < manifold.getNumContacts(); ++k)
      adjust(manifold.getContactPoint(k), manifold, info.m_timeStep, forgiven);
  }
  for (auto it = forgiven_.begin(); it != forgiven_.end();) {
    it->second = std::min(it->second, depth[it->first]);
    it = it->second > 0.0 ? std::next(it) : forgiven_.erase(it);
  }
  for (btManifoldPoint* point : redundant) {
    point->setDistance(2.0 * kIgnoredBeyond);
    point->m_appliedImpulse = point->m_appliedImpulseLateral1 = point->m_appliedImpulseLateral2 =
        0.0;
  }
  btDiscreteDynamicsWorld::solveConstraints(info);
}

void BulletWorld::setPairSurface(const Pair& pair, std::optional<double> friction,
                                 std::optional<double> restitution) {
  if (friction || restitution)
    pair_surface_[pair] = {friction, restitution};
  else
    pair_surface_.erase(pair);
}

double BulletWorld::frictionOf(const btCollisionObject& a, const btCollisionObject& b) const {
  const auto own = pair_surface_.find(std::minmax({a.getUserIndex(), b.getUserIndex()}));
  if (own != pair_surface_.end() && own->second.friction) return *own->second.friction;
  return a.getFriction() * b.getFriction();
}

void BulletWorld::findTouches() {
  std::set<Pair> touching;
  new_touches_.clear();
  for (int i = 0; i < getDispatcher()->getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *getDispatcher()->getManifoldByIndexInternal(i);
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
      const btManifoldPoint& point = manifold.getContactPoint(k);
      if (point.m_appliedImpulse <= 0.0) continue;
      const Pair pair = pairOf(manifold);
      if (touching.insert(pair).second && touching_.count(pair) == 0)
        new_touches_.push_back({manifold.getBody0()->getUserIndex(),
                                manifold.getBody1()->getUserIndex(), point.getPositionWorldOnB(),
                                point.m_normalWorldOnB, closing_[pair]});
      break;
    }
  }
  touching_ = std::move(touching);
}

void BulletWorld::substep(double h) {
  stepSimulation(h, 0);
  findTouches();
  std::set<const btCollisionObject*> touched;
  for (int i = 0; i < getDispatcher()->getNumManifolds(); ++i) {
    const btPersistentManifold& manifold = *getDispatcher()->getManifoldByIndexInternal(i);
    if (manifold.getNumContacts() == 0) continue;
    touched.insert({manifold.getBody0(), manifold.getBody1()});
  }
  for (int i = 0; i < m_nonStaticRigidBodies.size(); ++i) {
    btRigidBody* body = m_nonStaticRigidBodies[i];
    if (!isDynamic(body) || !body->isActive() || touched.count(body)) continue;
    body->translate(-0.5 * h * h * body->getGravity());
  }
}

}  // namespace calipso::fem
