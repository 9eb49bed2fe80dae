#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "algorithm_creator.hpp"
#include "bullet_body.hpp"
#include "bullet_world.hpp"
#include "calipso_fem/world/rigid_world.hpp"
#include "coulomb_solver.hpp"
#include "hull_contact.hpp"
#include "plane_contact.hpp"

namespace calipso::fem {

// Excluded pairs; every other pair that Bullet would test is tested.
struct PairFilter : btOverlapFilterCallback {
  std::set<BulletWorld::Pair> excluded;
  bool needBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const override {
    const auto* oa = static_cast<const btCollisionObject*>(a->m_clientObject);
    const auto* ob = static_cast<const btCollisionObject*>(b->m_clientObject);
    if (!BulletWorld::isDynamic(oa) && !BulletWorld::isDynamic(ob)) return false;
    return excluded.count(std::minmax({oa->getUserIndex(), ob->getUserIndex()})) == 0;
  }
};

struct RigidWorld::Impl {
  using Body = BulletBody;

  // Bullet's pool has room for its own algorithms only, and does not check.
  static btDefaultCollisionConstructionInfo withOwnAlgorithms() {
    btDefaultCollisionConstructionInfo info;
    info.m_customCollisionAlgorithmMaxElementSize =
        static_cast<int>(std::max({sizeof(HullPlaneAlgorithm), sizeof(CompoundPlaneAlgorithm),
                                   sizeof(HullHullAlgorithm), sizeof(CompoundPairAlgorithm)}));
    return info;
  }

  btDefaultCollisionConfiguration configuration{withOwnAlgorithms()};
  AlgorithmCreator<HullPlaneAlgorithm> on_plane, under_hull;
  AlgorithmCreator<HullHullAlgorithm> hull_on_hull;
  AlgorithmCreator<CompoundPairAlgorithm> hulls_on_hulls;
  AlgorithmCreator<CompoundPlaneAlgorithm> hulls_on_plane, under_hulls;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  CoulombSolver solver;
  BulletWorld world{&dispatcher, &broadphase, &solver, &configuration};
  PairFilter filter;
  std::map<Id, Body> bodies;
  Id next = 0;
  double substep = 1.0 / 960.0;  // s, of the last step
  std::vector<TouchEvent> touches;

  Impl() {
    under_hull.m_swapped = under_hulls.m_swapped = true;
    dispatcher.registerCollisionCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE,
                                           &on_plane);
    dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE,
                                           &under_hull);
    dispatcher.registerCollisionCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE,
                                           &hull_on_hull);
    dispatcher.registerCollisionCreateFunc(COMPOUND_SHAPE_PROXYTYPE, COMPOUND_SHAPE_PROXYTYPE,
                                           &hulls_on_hulls);
    dispatcher.registerCollisionCreateFunc(COMPOUND_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE,
                                           &hulls_on_plane);
    dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, COMPOUND_SHAPE_PROXYTYPE,
                                           &under_hulls);
    world.setGravity(btVector3(0, 0, 0));
    world.getPairCache()->setOverlapFilterCallback(&filter);
    btContactSolverInfo& info = world.getSolverInfo();
    info.m_numIterations = 40;
    info.m_leastSquaresResidualThreshold = 1e-12;   // (m/s)^2
    info.m_splitImpulsePenetrationThreshold = 0.0;  // depth is mended without giving velocity
    info.m_restitutionVelocityThreshold = 0.02;     // m/s
    info.m_solverMode |= SOLVER_USE_2_FRICTION_DIRECTIONS;
  }
  ~Impl() {
    for (auto& [id, b] : bodies) world.removeRigidBody(b.body.get());
  }
  Body& at(Id id) { return bodies.at(id); }
  const Body& at(Id id) const { return bodies.at(id); }

  // Gives pushed bodies their weight's impulse of a step h at once, and none within it.
  std::vector<std::pair<btRigidBody*, btVector3>> takeWeights(double h) {
    std::vector<std::pair<btRigidBody*, btVector3>> taken;
    for (auto& [id, b] : bodies) {
      if (!std::exchange(b.pushed, false)) continue;
      const btVector3 acceleration = b.body->getGravity();
      taken.emplace_back(b.body.get(), acceleration);
      b.body->setLinearVelocity(b.body->getLinearVelocity() + h * acceleration);
      b.body->setGravity(btVector3(0, 0, 0));
    }
    return taken;
  }

  // Corners of a dynamic body that are nearer to a plane than `reach` (m).
  void addPlaneTouches(Id id, double reach, std::vector<RigidTouch>& found) const;

  Id enter(Body body) {
    const Id id = next++;
    body.body->setUserIndex(id);
    body.body->setContactProcessingThreshold(BulletWorld::kIgnoredBeyond);
    world.addRigidBody(body.body.get());
    body.body->setGravity(btVector3(0, 0, 0));
    bodies.emplace(id, std::move(body));
    return id;
  }
};

}  // namespace calipso::fem
