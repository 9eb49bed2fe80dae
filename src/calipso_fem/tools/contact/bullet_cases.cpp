#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "calipso_fem/volume_mesh.hpp"
#include "contact_cases.hpp"

// The scenes of two_cubes in Bullet's own deformable contact, for comparison in the same run.
namespace calipso::fem {
namespace {

constexpr int kCells = 7;
constexpr double kSize = 0.5;

struct BulletScene {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btDeformableBodySolver bodies;
  btDeformableMultiBodyConstraintSolver solver;
  btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration,
                                           &bodies};
  btBoxShape ground{btVector3(10, 10, 1)};
  btRigidBody floor{0.0, nullptr, &ground};
  std::vector<std::unique_ptr<btDeformableLagrangianForce>> forces;
  std::vector<btSoftBody*> cubes;

  BulletScene() {
    solver.setDeformableSolver(&bodies);
    world.setGravity(btVector3(0, 0, -kG));
    world.getWorldInfo().m_gravity = world.getGravity();
    world.getWorldInfo().m_sparsesdf.setDefaultVoxelsz(0.25);
    floor.setWorldTransform(btTransform(btQuaternion::getIdentity(), btVector3(0, 0, -1)));
    floor.setFriction(0.1);
    world.addRigidBody(&floor);
  }
  ~BulletScene() {
    for (btSoftBody* cube : cubes) {
      for (auto& force : forces) world.removeForce(cube, force.get());
      world.removeSoftBody(cube);
      delete cube;
    }
    world.removeRigidBody(&floor);
  }

  void addCube(const Eigen::Vector3d& at) {
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * kSize);
    const VolumeMesh mesh =
        kuhnSplit(boxMesh(at - half, at + half, Eigen::Vector3i::Constant(kCells)));
    std::vector<btVector3> x;
    for (int i = 0; i < mesh.nodeCount(); ++i)
      x.emplace_back(mesh.node(i).x(), mesh.node(i).y(), mesh.node(i).z());
    const std::vector<btScalar> mass(x.size(), 1.0);
    auto* cube = new btSoftBody(&world.getWorldInfo(), mesh.nodeCount(), x.data(), mass.data());
    for (int c = 0; c < mesh.cellCount(); ++c) {
      const Eigen::RowVector4i t = mesh.cells.row(c).head<4>();
      cube->appendTetra(t[0], t[1], t[2], t[3]);
    }
    btSoftBodyHelpers::generateBoundaryFaces(cube);
    cube->initializeDmInverse();
    cube->m_tetraScratches.resize(cube->m_tetras.size());
    cube->m_tetraScratchesTn.resize(cube->m_tetras.size());
    cube->setTotalMass(1000.0 * kSize * kSize * kSize);
    cube->m_cfg.kKHR = 1;
    cube->m_cfg.kCHR = 1;
    cube->m_cfg.kDF = 0.1;
    cube->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::VF_DD;
    cube->getCollisionShape()->setMargin(0.005);
    cube->m_sleepingThreshold = 0;
    world.addSoftBody(cube);
    const double E = 1e5, nu = 0.3;
    forces.push_back(std::make_unique<btDeformableNeoHookeanForce>(
        E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu)), 0.01));
    world.addForce(cube, forces.back().get());
    forces.push_back(std::make_unique<btDeformableGravityForce>(btVector3(0, 0, -kG)));
    world.addForce(cube, forces.back().get());
    cubes.push_back(cube);
  }
};

std::vector<Result> cubesAt(int count, double rate) {
  BulletScene scene;
  for (int i = 0; i < count; ++i)
    scene.addCube(i == 0 ? Eigen::Vector3d(0, 0, 0.5) : Eigen::Vector3d(0.03, 0.02, 1.2));
  const int frames = 90;
  double lowest = 1.0;
  bool finite = true;
  const double before = processMs();
  int done = 0;
  for (; done < frames && finite; ++done) {
    for (int s = 0; s < std::lround(rate * kFrame); ++s) scene.world.stepSimulation(1.0 / rate, 0);
    for (btSoftBody* cube : scene.cubes)
      for (int i = 0; i < cube->m_nodes.size(); ++i) {
        const double z = cube->m_nodes[i].m_x.z();
        finite = finite && std::isfinite(z) && std::abs(z) < 100.0;
        lowest = std::min(lowest, z);
      }
  }
  const double ms = (processMs() - before) / done;
  return {{"Bullet: lowest node of " + std::to_string(count) + " soft cube(s), " +
               std::to_string(static_cast<int>(rate)) + " steps a second, m" +
               (finite ? "" : " (blew up)"),
           finite ? lowest : NAN, 0.0, std::max(0.0, -lowest) / 5e-3, 0.0, ms}};
}

}  // namespace

Cases bulletCases() {
  Cases cases;
  for (const int rate : {30, 120, 240, 480})
    cases["bullet_two_cubes_" + std::to_string(rate)] = [rate] { return cubesAt(2, rate); };
  return cases;
}

}  // namespace calipso::fem
