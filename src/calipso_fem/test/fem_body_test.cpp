#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/SparseLU>
#include <cmath>

#include "calipso_fem/deformable_body.hpp"
#include "calipso_fem/modal_analysis.hpp"

namespace calipso::fem {
namespace {

const Eigen::Vector3d kGravity(0.0, -9.81, 0.0);
const Material kSoft{1e6, 0.3, 1000.0, 0.0};

FemOptions exact() {
  FemOptions o;
  o.newton_iterations = 60;
  o.newton_tolerance = 1e-11;
  o.linear_tolerance = 1e-12;
  o.solver = SolverKind::kCholesky;
  return o;
}

DeformableBody clampedBeam(const FemOptions& options, const Material& material = kSoft) {
  DeformableBody body(boxMesh({0, 0, 0}, {1, 0.25, 0.25}, {8, 2, 2}), material, options);
  for (int i = 0; i < body.nodeCount(); ++i)
    if (body.model().mesh().nodes(i, 0) == 0.0) body.fixNode(i);
  return body;
}

TriangleMesh boxSurface(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  TriangleMesh mesh;
  mesh.vertices.resize(8, 3);
  for (int c = 0; c < 8; ++c)
    mesh.vertices.row(c) << (c & 1 ? high : low).x(), (c & 2 ? high : low).y(),
        (c & 4 ? high : low).z();
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 2, 3,
      0, 3, 1, 4, 5, 7, 4, 7, 6;
  return mesh;
}

constexpr ElementType kElements[] = {ElementType::kHexEnhanced, ElementType::kHexQ1,
                                     ElementType::kHexMeanDilatation, ElementType::kTetP1};

TEST(Statics, ReactionsBalanceWeightAndLoads) {
  for (const ElementType element : kElements)
    for (const MaterialModel material :
         {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
          MaterialModel::kStableNeoHookeanNoLog, MaterialModel::kCorotated,
          MaterialModel::kLinear}) {
      FemOptions options = exact();
      options.element = element;
      options.material_model = material;
      DeformableBody body = clampedBeam(options);
      body.setGravity(kGravity);
      Vec f = Vec::Zero(3 * body.nodeCount());
      f[3 * (body.nodeCount() - 1)] = 20.0;
      body.setNodalForces(f);
      const std::string what = toString(element) + " " + toString(material);
      ASSERT_TRUE(body.solveStatic().converged) << what;
      const Eigen::Vector3d load = body.totalMass() * kGravity + Eigen::Vector3d(20.0, 0.0, 0.0);
      EXPECT_LT((body.totalReaction() + load).norm(), 1e-8 * load.norm()) << what;
    }
}

TEST(Embedding, ConservesPower) {
  const TriangleMesh surface = boxSurface({0.1, 0.0, -0.2}, {1.3, 0.4, 0.5});
  FemOptions options;
  options.target_nodes = 200;
  const DeformableBody body(surface, kSoft, options);
  const Vec v = Vec::Random(3 * body.nodeCount()), f = Vec::Random(3 * surface.vertexCount());
  const double outside = body.embedding().apply(v).dot(f);
  const double inside = v.dot(body.embedding().applyTransposed(f));
  EXPECT_NEAR(outside, inside, 1e-13 * v.norm() * f.norm());
  const Eigen::Map<const Vec> rest(surface.vertices.data(), 3 * surface.vertexCount());
  EXPECT_LT((body.surfaceVertices() - rest).norm(), 1e-12);
}

// The step's elimination against the saddle-point system [A H^T; H 0] of the paper, section 8.
void expectEliminationAgrees(ElementType element) {
  FemOptions options = exact();
  options.linearised = true;
  options.element = element;
  DeformableBody body = clampedBeam(options);
  body.setGravity(kGravity);
  constexpr double h = 1.0 / 30.0;
  const int n = 3 * body.nodeCount();
  BlockMatrix K;
  body.model().hessian(body.positions(), Definiteness::kExact, K);
  std::vector<Eigen::Triplet<double>> entries;
  const Eigen::SparseMatrix<double> Ks = K.toSparse();
  Vec rhs = Vec::Zero(n);
  int rows = n;
  for (int c = 0; c < n; ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(Ks, c); it; ++it)
      entries.emplace_back(it.row(), it.col(), h * h * it.value());
    entries.emplace_back(c, c, body.model().lumpedMass()[c / 3]);
    rhs[c] = h * body.model().lumpedMass()[c / 3] * kGravity[c % 3];
    if (!body.isFixed(c / 3)) continue;
    entries.emplace_back(rows, c, 1.0);
    entries.emplace_back(c, rows++, 1.0);
  }
  Eigen::SparseMatrix<double> S(rows, rows);
  S.setFromTriplets(entries.begin(), entries.end());
  Vec b = Vec::Zero(rows);
  b.head(n) = rhs;
  const Eigen::SparseLU<Eigen::SparseMatrix<double>> lu(S);
  const Vec dv = Vec(lu.solve(b)).head(n);
  body.step(h);
  EXPECT_LT((body.velocities() - dv).norm(), 1e-10 * dv.norm()) << toString(element);
}

TEST(Constraints, EliminationAgreesWithMultipliers) {
  for (const ElementType element : kElements) expectEliminationAgrees(element);
}

TEST(Constraints, PrescribedMotionIsFollowed) {
  DeformableBody body = clampedBeam(exact());
  const int last = body.nodeCount() - 1;
  body.prescribe(last, 1, [](double t) { return 0.1 * t; });
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(body.step(0.1).converged);
  EXPECT_NEAR(body.positions()[3 * last + 1], body.model().mesh().nodes(last, 1) + 0.03, 1e-12);
  body.releaseNode(last);
  EXPECT_FALSE(body.isFixed(last));
}

TEST(Constraints, SoftConstraintPullsWithItsForce) {
  DeformableBody body = clampedBeam(exact());
  SoftConstraint spring;
  const int last = body.nodeCount() - 1;
  spring.point = SurfacePoint::vertex(last);
  spring.target = body.model().mesh().node(last) + Eigen::Vector3d(0.0, 0.1, 0.0);
  spring.stiffness = 500.0;
  body.setSoftConstraints({spring});
  ASSERT_TRUE(body.solveStatic().converged);
  const Eigen::Vector3d force = body.softConstraintForce(0);
  EXPECT_GT(force.y(), 0.0);
  EXPECT_LT((force + body.totalReaction()).norm(), 1e-7 * force.norm());
}

TEST(Time, SchemesConvergeWithTheirOrder) {
  // A small axial vibration, in its exact discrete frequency from modal analysis.
  const auto error = [](TimeScheme scheme, int steps) {
    FemOptions options = exact();
    options.scheme = scheme;
    options.material_model = MaterialModel::kLinear;
    options.element = ElementType::kHexQ1;
    DeformableBody body = clampedBeam(options);
    std::vector<int> fixed;
    for (int i = 0; i < body.nodeCount(); ++i)
      for (int axis = 0; body.isFixed(i) && axis < 3; ++axis) fixed.push_back(3 * i + axis);
    const ModalResult modes = naturalFrequencies(body.model(), fixed, 1, true);
    const Vec rest = restPositions(body.model().mesh()), phi = 1e-3 * modes.modes.col(0);
    body.setState(rest + phi, Vec::Zero(rest.size()));
    const double period = 1.0 / modes.frequencies[0];
    for (int k = 0; k < steps; ++k) body.step(period / steps);
    return (body.positions() - rest - phi).norm() / phi.norm();
  };
  EXPECT_GT(error(TimeScheme::kBackwardEuler, 100) / error(TimeScheme::kBackwardEuler, 200), 1.7);
  EXPECT_GT(error(TimeScheme::kTrapezoidal, 50) / error(TimeScheme::kTrapezoidal, 100), 3.5);
  EXPECT_GT(error(TimeScheme::kBdf2, 100) / error(TimeScheme::kBdf2, 200), 3.2);
}

TEST(Time, DampingTakesEnergyAndLeavesRigidMotion) {
  Material damped = kSoft;
  damped.damping = 0.05;
  DeformableBody body(boxMesh({0, 0, 0}, {0.4, 0.2, 0.2}, {4, 2, 2}), damped, exact());
  body.setRigidVelocity({1.0, 0.0, 0.0}, {0.0, 0.0, 0.0});
  const double before = body.kineticEnergy();
  for (int k = 0; k < 20; ++k) body.step(0.01);
  EXPECT_NEAR(body.kineticEnergy(), before, 1e-9 * before);
}

// Backward Euler alone would take (omega h)^2, a hundredth, of the spin in every step.
TEST(Time, FreeBodyKeepsItsSpinAndTurnsByTheTorque) {
  for (const bool lumped : {true, false}) {
    FemOptions options = exact();
    options.lumped_mass = lumped;
    DeformableBody body(boxMesh({0, 0, 0}, {0.3, 0.2, 0.1}, {3, 2, 1}), kSoft, options);
    body.setRigidVelocity({0.5, 0.0, 0.0}, {0.0, 0.0, 3.0});
    constexpr double h = 1.0 / 30.0;
    const Momentum before = body.momentum();
    for (int k = 0; k < 60; ++k) ASSERT_TRUE(body.step(h).converged);
    const Momentum after = body.momentum();
    EXPECT_LT((after.angular - before.angular).norm(), 1e-9 * before.angular.norm());
    EXPECT_LT((after.linear - before.linear).norm(), 1e-9 * before.linear.norm());
    // A pair of forces turns it by their moment.
    Vec f = Vec::Zero(3 * body.nodeCount());
    const Eigen::Vector3d push(0.0, 2.0, 0.0);
    f.segment<3>(0) = -push;
    f.tail<3>() = push;
    body.setNodalForces(f);
    ASSERT_TRUE(body.step(h).converged);
    const Eigen::Vector3d arm = body.positions().tail<3>() - body.positions().head<3>();
    const Eigen::Vector3d expected = after.angular + h * arm.cross(push);
    EXPECT_LT((body.momentum().angular - expected).norm(), 1e-9 * expected.norm());
  }
}

TEST(Solvers, AllGiveTheSameStep) {
  Vec expected;
  for (const SolverKind solver :
       {SolverKind::kCholesky, SolverKind::kJacobi, SolverKind::kIncompleteCholesky,
        SolverKind::kStaleCholesky, SolverKind::kMultigrid}) {
    FemOptions options = exact();
    options.solver = solver;
    DeformableBody body = clampedBeam(options);
    body.setGravity(kGravity);
    for (int k = 0; k < 5; ++k) ASSERT_TRUE(body.step(1.0 / 30.0).converged) << toString(solver);
    if (expected.size() == 0) expected = body.positions();
    EXPECT_LT((body.positions() - expected).norm(), 1e-8) << toString(solver);
  }
}

TEST(Online, MaterialGravityAndRestShapeChangeBetweenSteps) {
  DeformableBody body = clampedBeam(exact());
  body.setGravity(kGravity);
  body.solveStatic();
  const double sag = -body.positions()[3 * (body.nodeCount() - 1) + 1] + 0.25;
  Material stiffer = kSoft;
  stiffer.youngs_modulus *= 10.0;
  body.setMaterial(stiffer);
  body.solveStatic();
  const double less = -body.positions()[3 * (body.nodeCount() - 1) + 1] + 0.25;
  EXPECT_NEAR(less / sag, 0.1, 0.02);
  body.setGravity(Eigen::Vector3d::Zero());
  body.solveStatic();
  EXPECT_LT((body.positions() - restPositions(body.model().mesh())).norm(), 1e-8);
  NodeMatrix longer = body.model().mesh().nodes;
  longer.col(0) *= 1.1;
  body.setRestNodes(longer);
  body.solveStatic();
  EXPECT_NEAR(body.positions()[3 * (body.nodeCount() - 1)], 1.1, 1e-6);
}

TEST(Compliance, PredictsTheEffectOfAnImpulse) {
  FemOptions options = exact();
  options.linearised = true;
  constexpr double h = 0.01;
  const SurfacePoint point = SurfacePoint::vertex(80);
  const Eigen::Vector3d impulse(0.0, 0.3, 0.1);
  DeformableBody plain = clampedBeam(options), pushed = clampedBeam(options);
  Vec f = Vec::Zero(3 * pushed.nodeCount());
  f.segment<3>(3 * 80) = impulse / h;
  pushed.setNodalForces(f);
  pushed.step(h);
  const Vec column = plain.complianceColumn(point, impulse, h);
  EXPECT_LT((pushed.velocities() - column).norm(), 1e-8 * column.norm());
  const Eigen::MatrixXd W = plain.compliance(
      {point, SurfacePoint::vertex(70)}, {Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitX()}, h);
  EXPECT_GT(W(0, 0), 0.0);
  EXPECT_GT(W.determinant(), 0.0);
}

TEST(RestShape, GridFollowsItsSurface) {
  TriangleMesh surface = boxSurface({0, 0, 0}, {1.0, 0.3, 0.3});
  FemOptions options = exact();
  options.target_nodes = 150;
  DeformableBody body(surface, kSoft, options);
  surface.vertices.col(0) *= 1.2;
  body.setRestShape(surface);
  body.reset();
  const Eigen::Map<const Vec> target(surface.vertices.data(), surface.vertices.size());
  EXPECT_LT((body.surfaceVertices() - target).norm(), 0.01);
}

TEST(Input, ErrorsNameParameterValueAndRange) {
  DeformableBody body = clampedBeam(FemOptions{});
  const auto message = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message([&] { body.step(0.0); }).find("h is 0"), std::string::npos);
  EXPECT_NE(message([&] { body.step(std::nan("")); }).find("allowed"), std::string::npos);
  EXPECT_NE(message([&] {
              body.setGravity({0, std::nan(""), 0});
            }).find("gravity"),
            std::string::npos);
  EXPECT_NE(message([&] { body.setMaterial({1e6, 0.6, 1000, 0}); }).find("0.6"), std::string::npos);
  EXPECT_NE(message([&] { body.fixNode(-1); }).find("-1"), std::string::npos);
  EXPECT_NE(message([] { solverKindFromString("magic"); }).find("multigrid"), std::string::npos);
  FemOptions bad;
  bad.newton_tolerance = 0.0;
  EXPECT_NE(message([&] { validate(bad); }).find("newton_tolerance"), std::string::npos);
}

TEST(Input, UnheldBodyUnderGravityReportsThatItHasNoEquilibrium) {
  DeformableBody body(boxMesh({0, 0, 0}, {1, 1, 1}, {2, 2, 2}), kSoft, exact());
  body.setGravity(kGravity);
  const StepReport report = body.solveStatic();
  EXPECT_FALSE(report.converged);
  EXPECT_TRUE(body.positions().allFinite());
}

}  // namespace
}  // namespace calipso::fem
