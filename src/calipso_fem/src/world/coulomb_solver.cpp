#include "coulomb_solver.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::fem {
namespace {

// What the row's velocity lacks of its target, times -1.
double slipOf(const btSolverConstraint& row, btSolverBody& a, btSolverBody& b) {
  return row.m_contactNormal1.dot(a.internalGetDeltaLinearVelocity()) +
         row.m_relpos1CrossNormal.dot(a.internalGetDeltaAngularVelocity()) +
         row.m_contactNormal2.dot(b.internalGetDeltaLinearVelocity()) +
         row.m_relpos2CrossNormal.dot(b.internalGetDeltaAngularVelocity()) -
         row.m_rhs / row.m_jacDiagABInv;
}

void apply(btSolverConstraint& row, btSolverBody& a, btSolverBody& b, double impulse) {
  const double change = impulse - row.m_appliedImpulse;
  row.m_appliedImpulse = impulse;
  a.internalApplyImpulse(row.m_contactNormal1 * a.internalGetInvMass(), row.m_angularComponentA, change);
  b.internalApplyImpulse(row.m_contactNormal2 * b.internalGetInvMass(), row.m_angularComponentB, change);
}

}  // namespace

btScalar CoulombSolver::solveNormal(btSolverConstraint& contact) {
  const double off = resolveSingleConstraintRowLowerLimit(
      m_tmpSolverBodyPool[contact.m_solverBodyIdA], m_tmpSolverBodyPool[contact.m_solverBodyIdB], contact);
  return off * off;
}

// p <- projection of p - r u onto the disk: r not above the smaller of the two inverse masses makes it a
// contraction, and r alike for both makes the friction of what slides opposite to the slip.
btScalar CoulombSolver::solveFriction(btSolverConstraint& u, btSolverConstraint& v, double limit) {
  if (limit <= 0.0 && u.m_appliedImpulse == 0.0 && v.m_appliedImpulse == 0.0) return 0.0;
  btSolverBody &a = m_tmpSolverBodyPool[u.m_solverBodyIdA], &b = m_tmpSolverBodyPool[u.m_solverBodyIdB];
  const double r = std::min(u.m_jacDiagABInv, v.m_jacDiagABInv);
  double p = u.m_appliedImpulse - r * slipOf(u, a, b), q = v.m_appliedImpulse - r * slipOf(v, a, b);
  const double length = std::sqrt(p * p + q * q);
  if (length > limit) p *= limit / length, q *= limit / length;
  const double dp = p - u.m_appliedImpulse, dq = q - v.m_appliedImpulse;
  apply(u, a, b, p);
  apply(v, a, b, q);
  return (dp * dp + dq * dq) / (r * r);
}

btScalar CoulombSolver::solveRolling(btSolverConstraint& row, double normal) {
  const double limit = std::min<double>(row.m_friction, row.m_friction * normal);
  row.m_lowerLimit = -limit;
  row.m_upperLimit = limit;
  const double off = resolveSingleConstraintRowGeneric(m_tmpSolverBodyPool[row.m_solverBodyIdA],
                                                       m_tmpSolverBodyPool[row.m_solverBodyIdB], row);
  return off * off;
}

btScalar CoulombSolver::solveSingleIteration(int, btCollisionObject**, int, btPersistentManifold**, int,
                                             btTypedConstraint**, int, const btContactSolverInfo&,
                                             btIDebugDraw*) {
  btScalar off = 0.0;
  auto& contacts = m_tmpSolverContactConstraintPool;
  auto& friction = m_tmpSolverContactFrictionConstraintPool;
  for (int i = 0; i < contacts.size(); ++i) off = std::max(off, solveNormal(contacts[i]));
  for (int i = 0; i + 1 < friction.size(); i += 2) {
    const btSolverConstraint& contact = contacts[friction[i].m_frictionIndex];
    off = std::max(off, solveFriction(friction[i], friction[i + 1],
                                      friction[i].m_friction * contact.m_appliedImpulse));
  }
  auto& rolling = m_tmpSolverContactRollingFrictionConstraintPool;
  for (int i = 0; i < rolling.size(); ++i)
    off = std::max(off, solveRolling(rolling[i], contacts[rolling[i].m_frictionIndex].m_appliedImpulse));
  return off;
}

}  // namespace calipso::fem
