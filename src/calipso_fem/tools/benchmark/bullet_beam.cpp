#include "bullet_beam.hpp"

#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableGravityForce.h>
#include <BulletSoftBody/btDeformableLinearElasticityForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <Eigen/Geometry>
#include <ctime>
#include <memory>
#include <vector>

#include "calipso_fem/volume_mesh.hpp"

namespace calipso::fem {
namespace {

constexpr double kDensity = 1000.0, kYoung = 1e6, kPoisson = 0.3;

// Everything a world needs, in the order of destruction that Bullet asks for.
struct World {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btDeformableBodySolver deformable_solver;
  btDeformableMultiBodyConstraintSolver constraint_solver;
  std::unique_ptr<btDeformableMultiBodyDynamicsWorld> world;
  btDeformableLinearElasticityForce elasticity{
      btScalar(kYoung / (2.0 * (1.0 + kPoisson))),
      btScalar(kYoung* kPoisson / ((1.0 + kPoisson) * (1.0 - 2.0 * kPoisson))), 0, 0};
  btDeformableGravityForce gravity{btVector3(0, btScalar(-9.81), 0)};

  World() {
    constraint_solver.setDeformableSolver(&deformable_solver);
    world = std::make_unique<btDeformableMultiBodyDynamicsWorld>(
        &dispatcher, &broadphase, &constraint_solver, &configuration, &deformable_solver);
    world->setGravity(btVector3(0, btScalar(-9.81), 0));
    world->setImplicit(true);
    world->setLineSearch(false);
    world->setUseProjection(true);
  }
};

std::unique_ptr<btSoftBody> makeBody(World& w, const VolumeMesh& tets) {
  std::vector<btVector3> positions;
  for (int i = 0; i < tets.nodeCount(); ++i)
    positions.emplace_back(tets.nodes(i, 0), tets.nodes(i, 1), tets.nodes(i, 2));
  std::vector<double> mass(positions.size(), 0.0);
  auto body = std::make_unique<btSoftBody>(&w.world->getWorldInfo(), tets.nodeCount(),
                                           positions.data(), nullptr);
  for (int cell = 0; cell < tets.cellCount(); ++cell) {
    const auto c = tets.cells.row(cell);
    body->appendTetra(c[0], c[1], c[2], c[3]);
    const Eigen::Vector3d a = tets.node(c[0]);
    const double volume =
        (tets.node(c[1]) - a).cross(tets.node(c[2]) - a).dot(tets.node(c[3]) - a) / 6;
    for (int k = 0; k < 4; ++k) mass[c[k]] += 0.25 * kDensity * volume;
  }
  for (int i = 0; i < tets.nodeCount(); ++i)
    body->setMass(i, tets.nodes(i, 0) == 0.0 ? btScalar(0) : btScalar(mass[i]));
  body->initializeDmInverse();
  body->m_tetraScratches.resize(body->m_tetras.size());
  body->m_tetraScratchesTn.resize(body->m_tetras.size());
  body->setActivationState(DISABLE_DEACTIVATION);
  body->m_cfg.collisions = 0;
  return body;
}

}  // namespace

BulletResult runBulletBeam(int n, double h, int steps) {
  World w;
  const VolumeMesh tets = kuhnSplit(boxMesh({0, 0, 0}, {1.0, 0.25, 0.25}, {4 * n, n, n}));
  const std::unique_ptr<btSoftBody> body = makeBody(w, tets);
  w.world->addSoftBody(body.get());
  w.world->addForce(body.get(), &w.elasticity);
  w.world->addForce(body.get(), &w.gravity);
  const std::clock_t start = std::clock();
  for (int k = 0; k < steps; ++k) w.world->stepSimulation(btScalar(h), 1, btScalar(h));
  BulletResult r;
  r.nodes = tets.nodeCount();
  r.cpu_ms_per_step = 1000.0 * (std::clock() - start) / CLOCKS_PER_SEC / steps;
  int count = 0;
  for (int i = 0; i < tets.nodeCount(); ++i)
    if (tets.nodes(i, 0) > 1.0 - 1e-9) {
      r.tip += body->m_nodes[i].m_x.y() - tets.nodes(i, 1);
      ++count;
    }
  r.tip /= count;
  w.world->removeSoftBody(body.get());
  return r;
}

}  // namespace calipso::fem
