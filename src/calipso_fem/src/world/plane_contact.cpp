#include "plane_contact.hpp"

#include <cmath>
#include <functional>

namespace calipso::fem {
namespace {

// Where `gain` is most, if it is anything there.
const PlaneCorner* best(const std::vector<PlaneCorner>& corners,
                        const std::function<double(const PlaneCorner&)>& gain) {
  const PlaneCorner* found = nullptr;
  double most = 0.0;
  for (const PlaneCorner& c : corners)
    if (const double g = gain(c); g > most) most = g, found = &c;
  return found;
}

// The deepest corner, the one furthest from it, and those furthest from the line through both.
std::vector<PlaneCorner> spanning(const std::vector<PlaneCorner>& corners,
                                  const btVector3& normal) {
  std::vector<PlaneCorner> chosen;
  for (const PlaneCorner& c : corners)
    if (chosen.empty() || c.height < chosen[0].height) chosen.assign(1, c);
  if (chosen.empty()) return chosen;
  const btVector3 first = chosen[0].point;
  const PlaneCorner* far =
      best(corners, [&](const PlaneCorner& c) { return (c.point - first).length2(); });
  if (!far) return chosen;
  chosen.push_back(*far);
  const btVector3 across = normal.cross(far->point - first);
  for (const double side : {1.0, -1.0})
    if (const PlaneCorner* c =
            best(corners, [&](const PlaneCorner& k) { return side * across.dot(k.point - first); }))
      chosen.push_back(*c);
  return chosen;
}

// Contacts are kept up to this distance, m.
double reachOf(const btCollisionObject* body) {
  return body->getCollisionShape()->getContactBreakingThreshold(gContactBreakingThreshold);
}

}  // namespace

std::vector<PlaneCorner> spanningCorners(const btConvexHullShape& hull,
                                         const btTransform& plane_from_hull,
                                         const btStaticPlaneShape& plane, double reach) {
  const btVector3& normal = plane.getPlaneNormal();
  const btVector3 rise = normal * plane_from_hull.getBasis();  // of the height, in the hull's frame
  const double level =
      normal.dot(plane_from_hull.getOrigin()) - plane.getPlaneConstant() - hull.getMargin();
  std::vector<PlaneCorner> near;
  for (int i = 0; i < hull.getNumPoints(); ++i) {
    const btVector3& x = hull.getUnscaledPoints()[i];
    const double height = level + rise.dot(x);
    if (height < reach) near.push_back({plane_from_hull * x, height});
  }
  return spanning(near, normal);
}

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
  const std::vector<PlaneCorner> near =
      spanningCorners(shape, plane_from_hull, ground, reachOf(hull->getCollisionObject()));
  if ((near.empty() && !manifold_) || !manifoldOf(hull, plane)) return;
  result->setPersistentManifold(manifold_);
  const btTransform& world_from_plane = plane->getWorldTransform();
  const btVector3 up = world_from_plane.getBasis() * normal;
  for (const PlaneCorner& c : near)
    result->addContactPoint(
        up, world_from_plane * (c.point - (c.height + shape.getMargin()) * normal), c.height);
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
