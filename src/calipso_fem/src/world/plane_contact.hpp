#pragma once

#include <btBulletCollisionCommon.h>

// Private to the rigid world.
namespace calipso::fem {

// Convex hull against a plane: up to four vertices, the deepest and those that span the most with it. Bullet
// finds one per step, so that a body put down flat rocks until it has found all its corners.
class HullPlaneAlgorithm : public btCollisionAlgorithm {
 public:
  struct Creator : btCollisionAlgorithmCreateFunc {
    btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                   const btCollisionObjectWrapper* a,
                                                   const btCollisionObjectWrapper* b) override;
  };

  // swapped: the plane is the first of the two
  HullPlaneAlgorithm(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* a,
                     const btCollisionObjectWrapper* b, bool swapped);
  ~HullPlaneAlgorithm() override;
  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override;
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1.0;
  }
  void getAllContactManifolds(btManifoldArray& manifolds) override;

 private:
  bool swapped_, owner_ = false;
  btPersistentManifold* manifold_;
};

}  // namespace calipso::fem
