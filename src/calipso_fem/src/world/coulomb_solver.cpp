#include "coulomb_solver.hpp"

namespace calipso::fem {
namespace {

Four packed(const btVector3& v) { return Four{v.x(), v.y(), v.z(), 0.0}; }
btVector3 unpacked(const Four& v) { return {v[0], v[1], v[2]}; }

}  // namespace

RigidRow CoulombSolver::packed(const btSolverConstraint& row) {
  RigidRow r;
  // Bullet leaves a static body's normal zero, whichever of the two it is.
  r.normal = fem::packed(row.m_contactNormal1.isZero() ? -row.m_contactNormal2
                                                       : row.m_contactNormal1);
  r.turn_a = fem::packed(row.m_relpos1CrossNormal);
  r.turn_b = fem::packed(row.m_relpos2CrossNormal);
  r.angular_a = fem::packed(row.m_angularComponentA);
  r.angular_b = fem::packed(row.m_angularComponentB);
  r.inverse = row.m_jacDiagABInv;
  r.target = row.m_rhs / row.m_jacDiagABInv;
  r.softness = row.m_cfm / row.m_jacDiagABInv;
  r.impulse = row.m_appliedImpulse;
  r.a = row.m_solverBodyIdA;
  r.b = row.m_solverBodyIdB;
  return r;
}

void CoulombSolver::pack() {
  rows_.bodies.clear();
  for (int i = 0; i < m_tmpSolverBodyPool.size(); ++i) {
    btSolverBody& body = m_tmpSolverBodyPool[i];
    rows_.bodies.push_back({fem::packed(body.internalGetDeltaLinearVelocity()),
                            fem::packed(body.internalGetDeltaAngularVelocity()),
                            body.internalGetInvMass().x()});
  }
  const auto& friction = m_tmpSolverContactFrictionConstraintPool;
  const auto& rolling = m_tmpSolverContactRollingFrictionConstraintPool;
  rows_.contacts.resize(m_tmpSolverContactConstraintPool.size());
  for (size_t i = 0; i < rows_.contacts.size(); ++i)
    rows_.contacts[i].normal = packed(m_tmpSolverContactConstraintPool[static_cast<int>(i)]);
  for (int i = 0; i + 1 < friction.size(); i += 2) {
    RigidContact& contact = rows_.contacts[friction[i].m_frictionIndex];
    contact.u = packed(friction[i]);
    contact.v = packed(friction[i + 1]);
    contact.friction = friction[i].m_friction;
  }
  rows_.rolling.clear();
  for (int i = 0; i < rolling.size(); ++i)
    rows_.rolling.push_back(
        {packed(rolling[i]), rolling[i].m_friction, rolling[i].m_frictionIndex});
}

void CoulombSolver::unpack() {
  for (size_t i = 0; i < rows_.bodies.size(); ++i) {
    btSolverBody& body = m_tmpSolverBodyPool[static_cast<int>(i)];
    body.internalGetDeltaLinearVelocity() = unpacked(rows_.bodies[i].linear);
    body.internalGetDeltaAngularVelocity() = unpacked(rows_.bodies[i].angular);
  }
  auto& friction = m_tmpSolverContactFrictionConstraintPool;
  auto& rolling = m_tmpSolverContactRollingFrictionConstraintPool;
  for (size_t i = 0; i < rows_.contacts.size(); ++i)
    m_tmpSolverContactConstraintPool[static_cast<int>(i)].m_appliedImpulse =
        rows_.contacts[i].normal.impulse;
  for (int i = 0; i + 1 < friction.size(); i += 2) {
    const RigidContact& contact = rows_.contacts[friction[i].m_frictionIndex];
    friction[i].m_appliedImpulse = contact.u.impulse;
    friction[i + 1].m_appliedImpulse = contact.v.impulse;
  }
  for (int i = 0; i < rolling.size(); ++i)
    rolling[i].m_appliedImpulse = rows_.rolling[i].row.impulse;
}

btScalar CoulombSolver::solveGroupCacheFriendlyIterations(
    btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds,
    int manifold_count, btTypedConstraint** constraints, int constraint_count,
    const btContactSolverInfo& info, btIDebugDraw* drawer) {
  solveGroupCacheFriendlySplitImpulseIterations(bodies, body_count, manifolds, manifold_count,
                                                constraints, constraint_count, info, drawer);
  pack();
  for (int k = 0; k < info.m_numIterations; ++k)
    if (sweepRows(rows_) <= info.m_leastSquaresResidualThreshold) break;
  unpack();
  return 0.0;
}

}  // namespace calipso::fem
