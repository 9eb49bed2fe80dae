#pragma once

#include <btBulletDynamicsCommon.h>

// Private to the rigid world.
namespace calipso::fem {

// NOTE: deviations from btSequentialImpulseConstraintSolver, each with its reason:
//  - friction lies in a disk of radius mu p_n; Bullet's square allows 1.41 times as much across it;
//  - friction follows the normal impulse down to none; Bullet leaves a contact that opens within the
//    iteration what friction it had, which brakes everything that slides and rocks by some per cent.
// There are no joints in the rigid world; every contact has its two friction rows.
class CoulombSolver : public btSequentialImpulseConstraintSolver {
 protected:
  btScalar solveSingleIteration(int iteration, btCollisionObject** bodies, int body_count,
                                btPersistentManifold** manifolds, int manifold_count,
                                btTypedConstraint** constraints, int constraint_count,
                                const btContactSolverInfo& info, btIDebugDraw* drawer) override;

 private:
  // Each returns the square of the largest change of velocity that it was off by.
  btScalar solveNormal(btSolverConstraint& contact);
  btScalar solveFriction(btSolverConstraint& u, btSolverConstraint& v, double limit);
  btScalar solveRolling(btSolverConstraint& row, double normal);
};

}  // namespace calipso::fem
