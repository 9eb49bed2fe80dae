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
#include <set>
#include <utility>

#include "calipso_fem/volume_mesh.hpp"
#include "contact_cases.hpp"

// The scenes of falling_cubes in Bullet's own deformable contact, for comparison in the same run.
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
  const TriangleMesh boundary = test::boxSurface({kSize, kSize, kSize}, kCells);
  std::vector<std::vector<int>> boundary_nodes;  // by cube

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
    std::set<std::pair<int, int>> edges;
    for (int c = 0; c < mesh.cellCount(); ++c) {
      const Eigen::RowVector4i t = mesh.cells.row(c).head<4>();
      cube->appendTetra(t[0], t[1], t[2], t[3]);
      // Edges bear nothing, but Bullet's tree of nodes is built along them, and never ends without.
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < i; ++j)
          if (edges.insert(std::minmax(t[i], t[j])).second) cube->appendLink(t[i], t[j]);
    }
    btSoftBodyHelpers::generateBoundaryFaces(cube);
    cube->initializeDmInverse();
    cube->m_tetraScratches.resize(cube->m_tetras.size());
    cube->m_tetraScratchesTn.resize(cube->m_tetras.size());
    cube->setTotalMass(1000.0 * kSize * kSize * kSize);
    cube->m_cfg.kKHR = 1;
    cube->m_cfg.kCHR = 1;
    cube->m_cfg.kDF = 0.1;
    cube->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN |
                             btSoftBody::fCollision::VF_DD;
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
    // The boundary's vertices among the nodes.
    std::vector<int> nodes;
    for (int v = 0; v < boundary.vertexCount(); ++v) {
      Eigen::Index node = 0;
      (mesh.nodes.rowwise() - (boundary.vertex(v) + at).transpose())
          .rowwise()
          .squaredNorm()
          .minCoeff(&node);
      nodes.push_back(static_cast<int>(node));
    }
    boundary_nodes.push_back(nodes);
  }

  std::vector<TriangleMesh> surfaces() const {
    std::vector<TriangleMesh> list;
    for (size_t k = 0; k < cubes.size(); ++k) {
      list.push_back(boundary);
      for (int v = 0; v < boundary.vertexCount(); ++v) {
        const btVector3& x = cubes[k]->m_nodes[boundary_nodes[k][v]].m_x;
        list.back().vertices.row(v) << x.x(), x.y(), x.z();
      }
    }
    return list;
  }
};

// A second is all that is compared; a run that takes longer than this is stopped where it is.
constexpr int kFrames = 30;
constexpr double kMostMs = 10e3;  // CPU

std::vector<Result> cubesAt(int count, int rate) {
  BulletScene scene;
  for (int i = 0; i < count; ++i)
    scene.addCube(i == 0 ? Eigen::Vector3d(0, 0, 0.5) : Eigen::Vector3d(0.03, 0.02, 1.2));
  double lowest = 1.0, ms = 0.0, overlap = 0.0;
  bool finite = true;
  int done = 0;
  for (; done < kFrames && finite && ms < kMostMs; ++done) {
    const double before = processMs();
    for (int s = 0; s < rate / 30; ++s) scene.world.stepSimulation(1.0 / rate, 0);
    ms += processMs() - before;
    const std::vector<TriangleMesh> surfaces = scene.surfaces();
    for (const TriangleMesh& surface : surfaces) {
      finite =
          finite && surface.vertices.allFinite() && surface.vertices.cwiseAbs().maxCoeff() < 100.0;
      lowest = std::min(lowest, surface.vertices.col(2).minCoeff());
    }
    if (finite) overlap = std::max(overlap, deepestOverlap(surfaces));
  }
  std::string quantity = "Bullet: lowest vertex of " + cubes(count) + ", " + std::to_string(rate) +
                         " steps a second, m";
  if (!finite) quantity += " (blew up in frame " + std::to_string(done) + ")";
  if (finite && done < kFrames) quantity += " (stopped after " + std::to_string(done) + " frames)";
  return {{quantity, finite ? lowest : NAN, 0.0, overlap / 5e-3, 0.0, ms / done}};
}

}  // namespace

Cases bulletCases() {
  Cases cases;
  for (const int rate : {30, 60, 120, 240}) {
    cases["bullet_cube_" + std::to_string(rate)] = [rate] { return cubesAt(1, rate); };
    cases["bullet_two_cubes_" + std::to_string(rate)] = [rate] { return cubesAt(2, rate); };
  }
  return cases;
}

}  // namespace calipso::fem
