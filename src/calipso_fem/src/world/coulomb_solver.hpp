#pragma once

#include <btBulletDynamicsCommon.h>

#include "coulomb_kernel.hpp"

// Private to the rigid world.
namespace calipso::fem {

// NOTE: deviations from btSequentialImpulseConstraintSolver, each with its reason:
//  - friction lies in a disk of radius mu p_n; Bullet's square allows 1.41 times as much across it;
//  - friction follows the normal impulse down to none; Bullet leaves a contact that opens within
//  the
//    iteration what friction it had, which brakes everything that slides and rocks by some per
//    cent;
//  - the sweeps run over compact copies of the rows, three components at once.
// There are no joints in the rigid world; every contact has its two friction rows, and no body's
// motion is limited to some axes.
class CoulombSolver : public btSequentialImpulseConstraintSolver {
 protected:
  btScalar solveGroupCacheFriendlyIterations(btCollisionObject** bodies, int body_count,
                                             btPersistentManifold** manifolds, int manifold_count,
                                             btTypedConstraint** constraints, int constraint_count,
                                             const btContactSolverInfo& info,
                                             btIDebugDraw* drawer) override;

 private:
  static RigidRow packed(const btSolverConstraint& row);
  void pack();
  void unpack();

  RigidRows rows_;
};

}  // namespace calipso::fem
