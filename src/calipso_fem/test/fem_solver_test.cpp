#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>

#include "append_box.hpp"
#include "calipso_fem/condensed_factor.hpp"
#include "calipso_fem/deformable_body.hpp"
#include "hex_solver.hpp"
#include "preconditioner.hpp"
#include "thread_team.hpp"
#include "threads.hpp"

extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));
extern "C" int openblas_get_num_threads() __attribute__((weak));

namespace calipso::fem {
namespace {

constexpr double kStep = 1.0 / 30.0;
const Material kRubber{1e5, 0.4, 900.0, 0.0};

enum class Cells { kFull, kCut, kSheared };

// 324 nodes; cut: any filled fraction, spread anyhow over the cell.
VolumeMesh makeMesh(Cells cells) {
  VolumeMesh mesh = boxMesh({0, 0, 0}, {0.8, 0.5, 0.4}, {8, 5, 5});
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  if (cells == Cells::kCut) {
    mesh.point_share.resize(mesh.cellCount(), 8);
    for (int c = 0; c < mesh.cellCount(); ++c) {
      mesh.fraction[c] = 0.1 + 0.9 * unit(random);
      for (int q = 0; q < 8; ++q) mesh.point_share(c, q) = 0.2 + unit(random);
      mesh.point_share.row(c) /= mesh.point_share.row(c).mean();
    }
  }
  if (cells == Cells::kSheared)
    for (int i = 0; i < mesh.nodeCount(); ++i)
      for (int k = 0; k < 3; ++k) mesh.nodes(i, k) += 0.02 * unit(random);
  return mesh;
}

Vec randomVector(Eigen::Index size, double amplitude, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> spread(-amplitude, amplitude);
  Vec v(size);
  for (double& value : v) value = spread(random);
  return v;
}

class MatrixFree : public testing::TestWithParam<std::tuple<Cells, ElementType>> {};

TEST_P(MatrixFree, ProductsEqualThoseOfTheAssembledTangent) {
  const auto& [cells, element] = GetParam();
  const ElasticModel model(makeMesh(cells), kRubber, MaterialModel::kStVenantKirchhoff, element);
  ASSERT_NE(model.hexes(), nullptr);
  const Vec x = restPositions(model.mesh()) + randomVector(model.dofCount(), 0.02, 3);
  const Vec u = randomVector(model.dofCount(), 1.0, 4);
  HexSolver solver(model.mesh(), *model.hexes());
  for (const bool positive : {false, true}) {
    BlockMatrix K;
    model.hessian(x, positive ? Definiteness::kPositive : Definiteness::kExact, K);
    HexEvaluation at;
    model.hexes()->evaluate(x, true, positive, &at);
    solver.setSystem(&at, HexSystem{}, model.lumpedMass(), {});
    Vec expected, product;
    K.multiply(u, expected);
    solver.multiply(u, &product);
    EXPECT_LT((product - expected).norm(), 1e-12 * expected.norm());  // round-off of 24 sums
  }
  BlockMatrix D;
  model.viscosity(x, D);
  HexEvaluation scratch;
  Vec expected, product;
  D.multiply(u, expected);
  model.hexes()->multiplyMaterial(x, u, &scratch, &product);
  EXPECT_LT((product - expected).norm(), 1e-12 * expected.norm());
}

TEST_P(MatrixFree, ForcesAreTheDerivativeOfTheEnergy) {
  const auto& [cells, element] = GetParam();
  const ElasticModel model(makeMesh(cells), kRubber, MaterialModel::kStVenantKirchhoff, element);
  const Vec x = restPositions(model.mesh()) + randomVector(model.dofCount(), 0.02, 5);
  const Vec u = randomVector(model.dofCount(), 1.0, 6);
  Vec f;
  model.gradient(x, f);
  constexpr double kDelta = 1e-6;
  const double slope =
      (model.energy(x + kDelta * u) - model.energy(x - kDelta * u)) / (2.0 * kDelta);
  EXPECT_NEAR(slope, f.dot(u),
              1e-6 * f.norm() * u.norm());  // second order in kDelta, and its rounding
}

INSTANTIATE_TEST_SUITE_P(
    AllCells, MatrixFree,
    testing::Combine(testing::Values(Cells::kFull, Cells::kCut, Cells::kSheared),
                     testing::Values(ElementType::kHexEnhanced, ElementType::kHexQ1)));

// A body held at one end, pulled by a spring, damped, swinging.
DeformableBody makeSwing(Cells cells, SolverKind solver, int threads) {
  FemOptions options;
  options.solver = solver;
  options.threads = threads;
  options.newton_tolerance = 1e-10;
  options.linear_tolerance = 1e-10;
  Material material = kRubber;
  material.damping = 0.01;
  DeformableBody body(makeMesh(cells), material, options);
  for (int i = 0; i < body.nodeCount(); ++i)
    if (body.model().mesh().lattice(i, 0) == 0) body.fixNode(i);
  body.setGravity({0.0, 0.0, -9.81});
  SoftConstraint spring;
  spring.point = SurfacePoint::vertex(body.nodeCount() - 1);
  spring.target = body.positions().tail<3>() + Eigen::Vector3d(0.0, 0.1, 0.1);
  spring.stiffness = 500.0;
  spring.damping = 1.0;
  body.setSoftConstraints({spring});
  return body;
}

TEST(Solver, MultigridGivesTheMotionOfADirectSolver) {
  for (const Cells cells : {Cells::kFull, Cells::kCut, Cells::kSheared}) {
    DeformableBody direct = makeSwing(cells, SolverKind::kCholesky, 2);
    DeformableBody multigrid = makeSwing(cells, SolverKind::kMultigrid, 2);
    for (int k = 0; k < 5; ++k) {
      EXPECT_TRUE(direct.step(kStep).converged);
      const StepReport report = multigrid.step(kStep);
      EXPECT_TRUE(report.converged);
      EXPECT_EQ(report.solver, "multigrid");
    }
    // Newton's tolerance, over five steps and the condition of the system.
    EXPECT_LT((direct.positions() - multigrid.positions()).norm(), 1e-7);
  }
}

// Where coarse nodes have fixed ones alone below them, nothing of their own comes into the cycle:
// it would weigh against whatever unit the stiffness is given in.
TEST(Solver, MultigridIsTheSameInEveryUnit) {
  const auto iterations = [](double unit) {
    FemOptions options;
    options.solver = SolverKind::kMultigrid;
    DeformableBody body(makeMesh(Cells::kFull), {1e5 * unit, 0.4, 900.0 * unit, 0.0}, options);
    for (int i = 0; i < body.nodeCount(); ++i)
      if (body.model().mesh().lattice(i, 0) <= 4) body.fixNode(i);
    body.setGravity({0.0, 0.0, -9.81});
    return body.step(kStep).linear_iterations;
  };
  EXPECT_EQ(iterations(1.0), iterations(std::ldexp(1.0, -24)));  // powers of 2 round to nothing
}

// Thin, damped, swinging fast: what its viscosity resists turns within a step.
DeformableBody makeSheet(SolverKind solver, double linear_tolerance = 1e-5) {
  FemOptions options;
  options.solver = solver;
  options.newton_tolerance = 1e-3;
  options.linear_tolerance = linear_tolerance;
  DeformableBody body(boxMesh({0, 0, 0}, {0.8, 0.6, 0.02}, {16, 12, 1}), {1e6, 0.4, 1000.0, 0.02},
                      options);
  for (int i = 0; i < body.nodeCount(); ++i)
    if (body.model().mesh().lattice(i, 0) == 0) body.fixNode(i);
  body.setGravity({0.0, 0.0, -9.81});
  return body;
}

// Newton converges as fast as with the assembled tangent.
TEST(Solver, MatrixFreeTangentKnowsWhereTheViscosityActs) {
  int iterations[2] = {0, 0};
  for (const bool direct : {false, true}) {
    DeformableBody sheet = makeSheet(direct ? SolverKind::kCholesky : SolverKind::kMultigrid);
    for (int k = 0; k < 20; ++k) {
      const StepReport report = sheet.step(kStep);
      EXPECT_TRUE(report.converged);
      iterations[direct] += report.newton_iterations;
    }
  }
  // Directions are solved only as well as they are worth: an iteration more here and there.
  EXPECT_LE(iterations[0], 1.3 * iterations[1]);
}

// What the parts of a step are asked for is no more than the step itself does.
TEST(Solver, AStepTakenInPartsSolvesTheSameDirections) {
  DeformableBody whole = makeSheet(SolverKind::kMultigrid),
                 parts = makeSheet(SolverKind::kMultigrid);
  const Vec none = Vec::Zero(3 * parts.nodeCount());
  int iterations[2] = {0, 0};
  for (int k = 0; k < 10; ++k) {
    const StepReport report = whole.step(kStep);
    parts.beginStep(kStep);
    parts.predictTrial();
    for (int i = 0; i < report.newton_iterations; ++i)
      parts.moveTrial(parts.trialPositions() + parts.trialDirection(none));
    iterations[0] += report.linear_iterations;
    iterations[1] += parts.endStep(none).linear_iterations;
  }
  EXPECT_LE(iterations[1], 1.1 * iterations[0]);
}

// No direction is solved further than the step has to come.
TEST(Solver, DirectionsAreSolvedNoBetterThanTheStep) {
  int iterations[2] = {0, 0};
  for (const bool tight : {false, true}) {
    DeformableBody sheet = makeSheet(SolverKind::kMultigrid, tight ? 1e-12 : 1e-5);
    for (int k = 0; k < 10; ++k) iterations[tight] += sheet.step(kStep).linear_iterations;
  }
  EXPECT_EQ(iterations[0], iterations[1]);
}

TEST(Solver, SameBytesForAnyNumberOfThreads) {
  for (const SolverKind solver : {SolverKind::kMultigrid, SolverKind::kJacobi}) {
    Vec first;
    for (const int threads : {1, 2, 3}) {
      DeformableBody body = makeSwing(Cells::kCut, solver, threads);
      for (int k = 0; k < 3; ++k) body.step(kStep);
      if (threads == 1) first = body.positions();
      EXPECT_TRUE(body.positions() == first) << threads << " threads";
    }
  }
  setThreads(2);
}

// One part is held, the other one, in cells beside it, by nothing at all.
TEST(Solver, SingularSystemsAreGivenUpSoon) {
  TriangleMesh parts;
  appendBox({0.0, 0.0, 0.0}, {8.0, 4.0, 3.4}, &parts);
  appendBox({3.0, 1.0, 3.7}, {5.0, 3.0, 4.6}, &parts);
  FemOptions options;
  options.solver = SolverKind::kMultigrid;
  options.cell_size = 1.0;
  options.has_anchor = true;
  DeformableBody body(parts, kRubber, options);
  for (int i = 0; i < body.nodeCount(); ++i)
    if (body.model().mesh().lattice(i, 0) == 0) body.fixNode(i);
  const Vec rest = body.positions();
  body.setGravity({0.0, 0.0, -9.81});
  const StepReport report = body.solveStatic();
  EXPECT_FALSE(report.converged);
  EXPECT_NE(report.message.find("free to move"), std::string::npos) << report.message;
  EXPECT_LT(report.linear_iterations, 500);  // a solve may take 1000
  EXPECT_TRUE(body.positions() == rest);
}

// Coarse nodes then move the same few nodes: their system is singular, that of the body is not.
TEST(Solver, WhereMostNodesAreFixedTheOthersMove) {
  TriangleMesh bar;
  appendBox({0.0, 0.0, 0.0}, {0.16, 0.03, 0.03}, &bar);
  FemOptions options;
  options.solver = SolverKind::kMultigrid;
  options.cell_size = 0.01;
  for (int seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    DeformableBody body(bar, kRubber, options);
    for (int i = 0; i < body.nodeCount(); ++i)
      if (random() % 8 > 0) body.fixNode(i);
    body.setGravity({0.0, 0.0, -9.81});
    const StepReport report = body.step(kStep);
    EXPECT_TRUE(report.converged) << seed << ": " << report.message;
  }
}

// Whoever factorises first, with or without a body.
TEST(Solver, BlasHasOneThread) {
  if (!openblas_set_num_threads) GTEST_SKIP() << "CHOLMOD stands on another BLAS than OpenBLAS";
  openblas_set_num_threads(2);
  const auto cholesky = makeCholesky();
  EXPECT_EQ(openblas_get_num_threads(), 1);
  openblas_set_num_threads(2);
  const CondensedFactor condensed;
  EXPECT_EQ(openblas_get_num_threads(), 1);
}

TEST(Solver, MaterialChangeIsFollowed) {
  DeformableBody changed = makeSwing(Cells::kFull, SolverKind::kMultigrid, 2);
  changed.step(kStep);
  changed.setMaterial({1e4, 0.3, 2000.0, 0.0});
  changed.reset();
  DeformableBody fresh(makeMesh(Cells::kFull), Material{1e4, 0.3, 2000.0, 0.0}, changed.options());
  for (int i = 0; i < fresh.nodeCount(); ++i)
    if (changed.isFixed(i)) fresh.fixNode(i);
  fresh.setGravity({0.0, 0.0, -9.81});
  changed.setSoftConstraints({});
  changed.step(kStep);
  fresh.step(kStep);
  EXPECT_LT((changed.positions() - fresh.positions()).norm(), 1e-8);
}

TEST(ThreadTeam, EveryShareIsWorkedOnOnceAndBarriersHold) {
  setThreads(2);
  constexpr int kCount = 1000;
  for (int round = 0; round < 200; ++round) {
    std::vector<int> value(kCount, 0), sum(kCount, 0);
    runParallel([&](const Crew& crew) {
      const auto [begin, end] = crew.share(kCount, 64);
      for (int k = begin; k < end; ++k) value[k] = k + round;
      crew.barrier();
      // What the other thread has written is there.
      for (int k = begin; k < end; ++k) sum[k] += value[k] + value[kCount - 1 - k];
    });
    for (int k = 0; k < kCount; ++k) ASSERT_EQ(sum[k], kCount - 1 + 2 * round);
  }
}

// Whichever thread meets it, and the threads go on serving.
TEST(ThreadTeam, WhatAShareThrowsComesToTheCaller) {
  for (int round = 0; round < 50; ++round) {
    std::vector<int> done(7, 0);
    const auto work = [&](int k) {
      if (k == 3 || k == 4) throw std::runtime_error("share " + std::to_string(k));
      done[k] = 1;
    };
    try {
      eachOnAThread(7, work);
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "share 3");
    }
    EXPECT_EQ(std::accumulate(done.begin(), done.end(), 0), 5);
  }
}

}  // namespace
}  // namespace calipso::fem
