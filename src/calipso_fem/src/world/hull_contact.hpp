#pragma once

#include <BulletCollision/CollisionDispatch/btCompoundCompoundCollisionAlgorithm.h>
#include <btBulletCollisionCommon.h>

// Private to the rigid world.
namespace calipso::fem {

// Two convex hulls. The direction in which they were found to be apart is tried first the next
// time: it often still tells that they are, at a tenth of the cost of a search.
class HullHullAlgorithm : public btActivatingCollisionAlgorithm {
 public:
  HullHullAlgorithm(const btCollisionAlgorithmConstructionInfo& info,
                    const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                    bool swapped);
  ~HullHullAlgorithm() override;
  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override;
  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1.0;
  }
  void getAllContactManifolds(btManifoldArray& manifolds) override;

 private:
  bool apart(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
             double reach) const;
  void search(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b, double reach,
              btManifoldResult* result);

  btVector3 axis_{0, 0, 0};  // from b to a, in a's frame; zero: not known
  btPersistentManifold* manifold_;
  bool owner_ = false;
};

// Two bodies of several hulls: none is looked at while their boxes are apart. Bullet's broad phase
// looks 2 cm around every body.
class CompoundPairAlgorithm : public btCompoundCompoundCollisionAlgorithm {
 public:
  using btCompoundCompoundCollisionAlgorithm::btCompoundCompoundCollisionAlgorithm;
  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override;

 private:
  bool clear_ = false;  // of each other, with no contact left
};

}  // namespace calipso::fem
