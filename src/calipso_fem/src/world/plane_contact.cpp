#include "plane_contact.hpp"

#include <cmath>
#include <functional>
#include <vector>

namespace calipso::fem {
namespace {

struct Corner {
  btVector3 point;  // on the hull, in the plane's frame
  double height;
};

// Where `gain` is most, if it is anything there.
const Corner* best(const std::vector<Corner>& corners,
                   const std::function<double(const Corner&)>& gain) {
  const Corner* found = nullptr;
  double most = 0.0;
  for (const Corner& c : corners)
    if (const double g = gain(c); g > most) most = g, found = &c;
  return found;
}

// The deepest corner, the one furthest from it, and those furthest from the line through both.
std::vector<const Corner*> spanning(const std::vector<Corner>& corners, const btVector3& normal) {
  std::vector<const Corner*> chosen;
  for (const Corner& c : corners)
    if (chosen.empty() || c.height < chosen[0]->height) chosen.assign(1, &c);
  if (chosen.empty()) return chosen;
  const btVector3 first = chosen[0]->point;
  const Corner* far = best(corners, [&](const Corner& c) { return (c.point - first).length2(); });
  if (!far) return chosen;
  chosen.push_back(far);
  const btVector3 across = normal.cross(far->point - first);
  for (const double side : {1.0, -1.0})
    if (const Corner* c =
            best(corners, [&](const Corner& k) { return side * across.dot(k.point - first); }))
      chosen.push_back(c);
  return chosen;
}

// Contacts are kept up to this distance, m.
double reachOf(const btCollisionObject* body) {
  return body->getCollisionShape()->getContactBreakingThreshold(gContactBreakingThreshold);
}

}  // namespace

HullPlaneAlgorithm::HullPlaneAlgorithm(const btCollisionAlgorithmConstructionInfo& info,
                                       const btCollisionObjectWrapper*,
                                       const btCollisionObjectWrapper*, bool swapped)
    : btCollisionAlgorithm(info), swapped_(swapped), manifold_(info.m_manifold) {}

HullPlaneAlgorithm::~HullPlaneAlgorithm() {
  if (owner_) m_dispatcher->releaseManifold(manifold_);
}

btPersistentManifold* HullPlaneAlgorithm::manifoldOf(const btCollisionObjectWrapper* hull,
                                                     const btCollisionObjectWrapper* plane) {
  if (!manifold_ &&
      m_dispatcher->needsCollision(hull->getCollisionObject(), plane->getCollisionObject())) {
    manifold_ =
        m_dispatcher->getNewManifold(hull->getCollisionObject(), plane->getCollisionObject());
    owner_ = true;
  }
  return manifold_;
}

void HullPlaneAlgorithm::processCollision(const btCollisionObjectWrapper* a,
                                          const btCollisionObjectWrapper* b,
                                          const btDispatcherInfo&, btManifoldResult* result) {
  const btCollisionObjectWrapper *hull = swapped_ ? b : a, *plane = swapped_ ? a : b;
  const auto& shape = *static_cast<const btConvexHullShape*>(hull->getCollisionShape());
  const auto& ground = *static_cast<const btStaticPlaneShape*>(plane->getCollisionShape());
  const btVector3& normal = ground.getPlaneNormal();
  const btTransform plane_from_hull =
      plane->getWorldTransform().inverseTimes(hull->getWorldTransform());
  const double reach = reachOf(hull->getCollisionObject());
  const btVector3 rise = normal * plane_from_hull.getBasis();  // of the height, in the hull's frame
  const double level =
      normal.dot(plane_from_hull.getOrigin()) - ground.getPlaneConstant() - shape.getMargin();
  std::vector<Corner> near;
  for (int i = 0; i < shape.getNumPoints(); ++i) {
    const btVector3& x = shape.getUnscaledPoints()[i];
    const double height = level + rise.dot(x);
    if (height < reach) near.push_back({plane_from_hull * x, height});
  }
  if ((near.empty() && !manifold_) || !manifoldOf(hull, plane)) return;
  result->setPersistentManifold(manifold_);
  const btTransform& world_from_plane = plane->getWorldTransform();
  const btVector3 up = world_from_plane.getBasis() * normal;
  for (const Corner* c : spanning(near, normal))
    result->addContactPoint(
        up, world_from_plane * (c->point - (c->height + shape.getMargin()) * normal), c->height);
  if (owner_ && manifold_->getNumContacts()) result->refreshContactPoints();
}

void HullPlaneAlgorithm::getAllContactManifolds(btManifoldArray& manifolds) {
  if (manifold_ && owner_) manifolds.push_back(manifold_);
}

void CompoundPlaneAlgorithm::processCollision(const btCollisionObjectWrapper* a,
                                              const btCollisionObjectWrapper* b,
                                              const btDispatcherInfo& info,
                                              btManifoldResult* result) {
  const btCollisionObjectWrapper *hulls = m_isSwapped ? b : a, *plane = m_isSwapped ? a : b;
  const auto& ground = *static_cast<const btStaticPlaneShape*>(plane->getCollisionShape());
  btVector3 low, high;
  hulls->getCollisionShape()->getAabb(
      plane->getWorldTransform().inverseTimes(hulls->getWorldTransform()), low, high);
  const btVector3 &normal = ground.getPlaneNormal(), half = 0.5 * (high - low);
  const double height =
      normal.dot(0.5 * (low + high)) - normal.absolute().dot(half) - ground.getPlaneConstant();
  const bool far = height > reachOf(hulls->getCollisionObject());
  if (far && clear_) return;
  btCompoundCollisionAlgorithm::processCollision(a, b, info, result);
  clear_ = far;
}

}  // namespace calipso::fem
