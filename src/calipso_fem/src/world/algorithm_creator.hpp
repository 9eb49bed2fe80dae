#pragma once

#include <btBulletCollisionCommon.h>

// Private to the rigid world.
namespace calipso::fem {

// How Bullet makes an algorithm for a pair, in memory of its own.
template <class Algorithm>
struct AlgorithmCreator : btCollisionAlgorithmCreateFunc {
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* a,
                                                 const btCollisionObjectWrapper* b) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(Algorithm));
    return new (memory) Algorithm(info, a, b, m_swapped);
  }
};

}  // namespace calipso::fem
