#pragma once

#include <BulletCollision/CollisionDispatch/btCompoundCollisionAlgorithm.h>
#include <btBulletCollisionCommon.h>

#include <vector>

// Private to the rigid world.
namespace calipso::fem {

// A corner of a hull over a plane.
struct PlaneCorner {
  btVector3 point;  // in the plane's frame
  double height;    // over the plane, less the hull's margin, m
};

// Up to four corners nearer to the plane than `reach` (m): the deepest and those that span the most
// with it.
std::vector<PlaneCorner> spanningCorners(const btConvexHullShape& hull,
                                         const btTransform& plane_from_hull,
                                         const btStaticPlaneShape& plane, double reach);

// Convex hull against a plane: up to four vertices, the deepest and those that span the most with
// it. Bullet finds one per step, so that a body put down flat rocks until it has found all its
// corners.
class HullPlaneAlgorithm : public btCollisionAlgorithm {
 public:
  // swapped: the plane is the first of the two
  HullPlaneAlgorithm(const btCollisionAlgorithmConstructionInfo& info,
                     const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                     bool swapped);
  ~HullPlaneAlgorithm() override;
  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override;
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1.0;
  }
  void getAllContactManifolds(btManifoldArray& manifolds) override;

 private:
  btPersistentManifold* manifoldOf(const btCollisionObjectWrapper* hull,
                                   const btCollisionObjectWrapper* plane);

  bool swapped_, owner_ = false;
  btPersistentManifold* manifold_;
};

// Several hulls against a plane: none of them is looked at while their box is clear of it. Every
// plane's own box is boundless, so that Bullet looks at all the hulls of all bodies at all times.
class CompoundPlaneAlgorithm : public btCompoundCollisionAlgorithm {
 public:
  using btCompoundCollisionAlgorithm::btCompoundCollisionAlgorithm;
  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override;

 private:
  bool clear_ = false;  // of the plane, with no contact left
};

}  // namespace calipso::fem
