#include "hull_contact.hpp"

#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include <algorithm>

namespace calipso::fem {
namespace {

const btConvexHullShape& hullOf(const btCollisionObjectWrapper* body) {
  return *static_cast<const btConvexHullShape*>(body->getCollisionShape());
}

// Contacts of a body are kept up to this distance, m.
double reachOf(const btCollisionObjectWrapper* body) {
  return body->getCollisionObject()->getCollisionShape()->getContactBreakingThreshold(
      gContactBreakingThreshold);
}

// How far the hull goes along a world direction, without its margin.
double extent(const btCollisionObjectWrapper* body, const btVector3& direction) {
  const btTransform& pose = body->getWorldTransform();
  const btVector3 along = direction * pose.getBasis();
  const btConvexHullShape& hull = hullOf(body);
  const btVector3* points = hull.getUnscaledPoints();
  double most = along.dot(points[0]);
  for (int i = 1; i < hull.getNumPoints(); ++i) most = std::max(most, along.dot(points[i]));
  return most + direction.dot(pose.getOrigin());
}

}  // namespace

HullHullAlgorithm::HullHullAlgorithm(const btCollisionAlgorithmConstructionInfo& info,
                                     const btCollisionObjectWrapper* a,
                                     const btCollisionObjectWrapper* b, bool)
    : btActivatingCollisionAlgorithm(info, a, b), manifold_(info.m_manifold) {}

HullHullAlgorithm::~HullHullAlgorithm() {
  if (owner_) m_dispatcher->releaseManifold(manifold_);
}

bool HullHullAlgorithm::apart(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                              double reach) const {
  if (axis_.isZero()) return false;
  const btVector3 axis = a->getWorldTransform().getBasis() * axis_;
  const double margins = hullOf(a).getMargin() + hullOf(b).getMargin();
  return -extent(a, -axis) - extent(b, axis) > margins + reach;
}

void HullHullAlgorithm::search(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                               double reach, btManifoldResult* result) {
  btVoronoiSimplexSolver simplex;
  btGjkEpaPenetrationDepthSolver penetration;
  btGjkPairDetector pair(&hullOf(a), &hullOf(b), &simplex, &penetration);
  btGjkPairDetector::ClosestPointInput input;
  const double distance = hullOf(a).getMargin() + hullOf(b).getMargin() + reach;
  input.m_maximumDistanceSquared = distance * distance;
  input.m_transformA = a->getWorldTransform();
  input.m_transformB = b->getWorldTransform();
  pair.getClosestPoints(input, *result, nullptr);
  const btVector3& axis = pair.getCachedSeparatingAxis();
  axis_ =
      axis.fuzzyZero() ? btVector3(0, 0, 0) : axis.normalized() * a->getWorldTransform().getBasis();
}

void HullHullAlgorithm::processCollision(const btCollisionObjectWrapper* a,
                                         const btCollisionObjectWrapper* b, const btDispatcherInfo&,
                                         btManifoldResult* result) {
  const double reach = std::min(reachOf(a), reachOf(b));
  const bool touching = manifold_ && manifold_->getNumContacts() > 0;
  if (!touching && apart(a, b, reach)) return;
  if (!manifold_) {
    manifold_ = m_dispatcher->getNewManifold(a->getCollisionObject(), b->getCollisionObject());
    owner_ = true;
  }
  result->setPersistentManifold(manifold_);
  search(a, b, reach, result);
  if (owner_) result->refreshContactPoints();
}

void HullHullAlgorithm::getAllContactManifolds(btManifoldArray& manifolds) {
  if (manifold_ && owner_) manifolds.push_back(manifold_);
}

void CompoundPairAlgorithm::processCollision(const btCollisionObjectWrapper* a,
                                             const btCollisionObjectWrapper* b,
                                             const btDispatcherInfo& info,
                                             btManifoldResult* result) {
  btVector3 low_a, high_a, low_b, high_b;
  a->getCollisionShape()->getAabb(a->getWorldTransform(), low_a, high_a);
  b->getCollisionShape()->getAabb(b->getWorldTransform(), low_b, high_b);
  const double reach = std::min(reachOf(a), reachOf(b));
  const btVector3 margin(reach, reach, reach);
  const bool far = !TestAabbAgainstAabb2(low_a - margin, high_a + margin, low_b, high_b);
  if (far && clear_) return;
  btCompoundCompoundCollisionAlgorithm::processCollision(a, b, info, result);
  clear_ = far;
}

}  // namespace calipso::fem
