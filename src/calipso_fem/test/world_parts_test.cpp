#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "../src/world/obstacle_query.hpp"
#include "calipso_fem/condensed_factor.hpp"
#include "calipso_fem/deformable_body.hpp"
#include "calipso_fem/world/contact_solver.hpp"
#include "calipso_fem/world/convex_decomposition.hpp"
#include "calipso_fem/world/mass_properties.hpp"
#include "calipso_fem/world/region_selection.hpp"
#include "calipso_fem/world/surface_tree.hpp"
#include "world_fixtures.hpp"

namespace calipso::fem {
namespace {

using test::boxSurface;
using test::sceneWith;
using test::sphereSurface;

TEST(MassProperties, OfABoxAreExact) {
  const Eigen::Vector3d size(1.0, 2.0, 3.0);
  const MassProperties m = massProperties(boxSurface(size, 2), 500.0);
  EXPECT_NEAR(m.mass, 3000.0, 1e-9);
  EXPECT_NEAR(m.center.norm(), 0.0, 1e-12);
  EXPECT_NEAR(m.inertia(0, 0), m.mass * (4.0 + 9.0) / 12.0, 1e-9);
  EXPECT_NEAR(m.inertia(2, 2), m.mass * (1.0 + 4.0) / 12.0, 1e-9);
  EXPECT_TRUE(m.note.empty());
}

TEST(MassProperties, InsideOutMeshIsTurned) {
  TriangleMesh box = boxSurface({1, 1, 1}, 1);
  box.triangles.col(1).swap(box.triangles.col(2));
  const MassProperties m = massProperties(box, 1000.0);
  EXPECT_NEAR(m.mass, 1000.0, 1e-9);
  EXPECT_FALSE(m.note.empty());
}

TEST(MassProperties, OpenMeshUsesItsHullAndSaysSo) {
  TriangleMesh box = boxSurface({1, 1, 1}, 1);
  box.triangles.conservativeResize(10, 3);
  const MassProperties m = massProperties(box, 1000.0);
  EXPECT_NEAR(m.mass, 1000.0, 1e-6);
  EXPECT_NE(m.note.find("hull"), std::string::npos);
}

// A fit can turn a thin hull inside out in places: its integrals are no solid's, and a body with
// such an inertia flies apart.
TEST(MassProperties, PartsInsideOutLeaveItToTheHull) {
  const TriangleMesh box = boxSurface({1, 1, 1}, 1);
  const Eigen::Index vertices = box.vertices.rows(), triangles = box.triangles.rows();
  TriangleMesh both = box;
  both.vertices.conservativeResize(2 * vertices, 3);
  both.triangles.conservativeResize(2 * triangles, 3);
  both.vertices.bottomRows(vertices) =
      (0.9 * box.vertices).rowwise() + Eigen::RowVector3d(3.0, 0.0, 0.0);
  both.triangles.bottomRows(triangles) = box.triangles.array() + static_cast<int>(vertices);
  both.triangles.bottomRows(triangles).col(1).swap(both.triangles.bottomRows(triangles).col(2));
  const MassProperties m = massProperties(both, 1000.0);
  EXPECT_GT(m.mass, 1000.0);
  EXPECT_GT(m.inertia.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0.0);
  EXPECT_NE(m.note.find("inside out"), std::string::npos);
}

TEST(MassProperties, RefusesFlatMeshAndBadDensity) {
  TriangleMesh flat = boxSurface({1, 1, 1}, 1);
  flat.vertices.col(2).setZero();
  EXPECT_THROW(massProperties(flat, 1000.0), std::invalid_argument);
  EXPECT_THROW(massProperties(boxSurface({1, 1, 1}, 1), 0.0), std::invalid_argument);
}

double totalVolume(const std::vector<TriangleMesh>& hulls) {
  double sum = 0.0;
  for (const TriangleMesh& hull : hulls) sum += signedVolume(hull);
  return sum;
}

// Two boxes joined to an L: the hull of the whole is a quarter too large.
TriangleMesh bracket() {
  TriangleMesh a = boxSurface({0.4, 0.1, 0.1}, 4), b = boxSurface({0.1, 0.1, 0.4}, 4);
  b.vertices.rowwise() += Eigen::RowVector3d(-0.15, 0.0, 0.15);
  TriangleMesh both;
  both.vertices.resize(a.vertexCount() + b.vertexCount(), 3);
  both.vertices << a.vertices, b.vertices;
  both.triangles.resize(a.triangleCount() + b.triangleCount(), 3);
  both.triangles << a.triangles, (b.triangles.array() + a.vertexCount()).matrix();
  return both;
}

TEST(ConvexDecomposition, ConvexShapeIsOneHull) {
  EXPECT_EQ(decomposeConvex(boxSurface({1, 2, 3}, 3)).size(), 1u);
}

TEST(ConvexDecomposition, PartsOfABracketFillLittleMoreThanIt) {
  const auto hulls = decomposeConvex(bracket());
  EXPECT_GE(hulls.size(), 2u);
  const double solid = 0.1 * 0.1 * 0.7;  // the boxes share a cube
  // Concavity tolerance 2 % plus the resolution of the volume grid.
  EXPECT_NEAR(totalVolume(hulls), solid, 0.06 * solid);
}

TEST(SurfaceTree, SignedDistanceToABox) {
  const SurfaceTree tree(boxSurface({2, 2, 2}, 3));
  EXPECT_NEAR(tree.nearest({0, 0, 1.5}, 1.0)->distance, 0.5, 1e-12);
  EXPECT_NEAR(tree.nearest({0.9, 0.1, 0}, 1.0)->distance, -0.1, 1e-12);
  EXPECT_NEAR(tree.nearest({2, 2, 2}, 5.0)->distance, std::sqrt(3.0), 1e-12);
  EXPECT_FALSE(tree.nearest({0, 0, 3}, 1.0));
}

TEST(SurfaceTree, FastPointIsCaught) {
  TriangleMesh plate = boxSurface({2, 2, 0.001}, 2);
  const auto hit = SurfaceTree(plate).firstEntry({0.1, 0.2, 1.0}, {0.1, 0.2, -1.0});
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance, -1.0005, 1e-9);
  EXPECT_NEAR(hit->normal.z(), 1.0, 1e-12);
}

TEST(SurfaceTree, RefitFollowsTheVertices) {
  SurfaceTree tree(boxSurface({2, 2, 2}, 2));
  auto moved = tree.mesh().vertices;
  moved.rowwise() += Eigen::RowVector3d(0, 0, 5);
  tree.refit(moved);
  EXPECT_NEAR(tree.nearest({0, 0, 6.25}, 1.0)->distance, 0.25, 1e-12);
}

// A cavity is outside, and what two surfaces enclose is inside.
TEST(Encloses, FollowsTheWindingNumber) {
  const TriangleMesh box = boxSurface({2, 2, 2}, 3), small = boxSurface({1, 1, 1}, 2);
  const auto joined = [](const TriangleMesh& a, const TriangleMesh& b, bool reversed) {
    TriangleMesh m = a;
    m.vertices.conservativeResize(a.vertices.rows() + b.vertices.rows(), 3);
    m.vertices.bottomRows(b.vertices.rows()) = b.vertices;
    m.triangles.conservativeResize(a.triangles.rows() + b.triangles.rows(), 3);
    m.triangles.bottomRows(b.triangles.rows()) =
        b.triangles.array() + static_cast<int>(a.vertices.rows());
    if (reversed)
      m.triangles.bottomRows(b.triangles.rows())
          .col(0)
          .swap(m.triangles.bottomRows(b.triangles.rows()).col(1));
    return m;
  };
  const TriangleMesh hollow = joined(box, small, true), doubled = joined(box, small, false);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d p(1.3 * std::sin(1.7 * k), 1.3 * std::sin(2.3 * k + 1.0),
                            1.3 * std::cos(0.9 * k));
    const double out = p.cwiseAbs().maxCoeff();
    EXPECT_EQ(encloses(box, p), out < 1.0) << p.transpose();
    EXPECT_EQ(encloses(doubled, p), out < 1.0) << p.transpose();
    EXPECT_EQ(encloses(hollow, p), out < 1.0 && out > 0.5) << p.transpose();
  }
}

TEST(ContactSolver, PointMassStopsAndSlidesAsCoulombSays) {
  const double mass = 2.0;
  std::vector<ContactRow> rows(1);
  rows[0].free_velocity = {-1.0, 1.0, 0.0};
  rows[0].friction = 0.3;
  const auto report = solveContacts(Eigen::Matrix3d::Identity() / mass, rows, 50, 1e-12);
  EXPECT_TRUE(report.converged);
  EXPECT_NEAR(rows[0].impulse[0], mass, 1e-9);
  EXPECT_NEAR(rows[0].impulse[1], -0.3 * mass, 1e-9);
}

TEST(ContactSolver, SeparatingContactGivesNoImpulse) {
  std::vector<ContactRow> rows(1);
  rows[0].free_velocity = {0.5, 1.0, 0.0};
  rows[0].friction = 1.0;
  rows[0].start_impulse = rows[0].impulse = {0.2, 0.0, 0.0};
  solveContacts(Eigen::Matrix3d::Identity(), rows, 50, 1e-12);
  EXPECT_EQ(rows[0].impulse.norm(), 0.0);
}

// A thousand units of mass on a light one, which stands on the ground, along a line: sweeps alone
// pass the weight on by a thousandth each.
TEST(ContactSolver, CarriesAHeavyBodyThroughALightOne) {
  const double light = 1.0, heavy = 1000.0, step = 0.1;  // kg, kg, velocity gained by falling, m/s
  std::vector<ContactRow> rows(2);                       // light on the ground, heavy on light
  rows[0].free_velocity = {-step, 0.0, 0.0};
  Eigen::MatrixXd W = Eigen::MatrixXd::Zero(6, 6);
  W.block<3, 3>(0, 0) = Eigen::Matrix3d::Identity() / light;
  W.block<3, 3>(3, 3) = Eigen::Matrix3d::Identity() * (1.0 / light + 1.0 / heavy);
  W.block<3, 3>(0, 3) = W.block<3, 3>(3, 0) = -Eigen::Matrix3d::Identity() / light;
  const auto report = solveContacts(W, rows, 60, 0.0, 1e-9);
  EXPECT_TRUE(report.converged) << report.iterations << " sweeps";
  EXPECT_NEAR(rows[1].impulse[0], heavy * step, 1e-6 * heavy * step);
  EXPECT_NEAR(rows[0].impulse[0], (heavy + light) * step, 1e-6 * heavy * step);
}

// The block's stiffness, held by `inertia` at every node.
BlockMatrix heldStiffness(const DeformableBody& body, double inertia) {
  BlockMatrix A;
  body.model().hessian(body.positions(), Definiteness::kPositive, A);
  for (const int k : A.pattern->diagonal) A.block(k).diagonal().array() += inertia;
  return A;
}

DeformableBody smallBlock() {
  FemOptions options;
  options.cell_size = 0.1;
  return DeformableBody(boxSurface({0.2, 0.2, 0.2}, 2), {1e5, 0.3, 1000.0, 0.0}, options);
}

TEST(CondensedFactor, AgreesWithTheWholeSystem) {
  const DeformableBody body = smallBlock();
  const BlockMatrix A = heldStiffness(body, 1e3);
  const Eigen::MatrixXd inverse = Eigen::MatrixXd(A.toSparse()).inverse();
  const std::vector<int> nodes = {0, 5, 13};
  CondensedFactor factor;
  ASSERT_TRUE(factor.update(A, nodes));
  const Vec b = Vec::LinSpaced(3 * body.nodeCount(), -1.0, 2.0), f = Vec::LinSpaced(9, 3.0, -5.0);
  Vec all = b;
  for (int k = 0; k < 3; ++k) all.segment<3>(3 * nodes[k]) += f.segment<3>(3 * k);
  const Vec without = inverse * b, with = inverse * all;
  const Vec reduced = factor.reduce(b);
  // Round-off of a system with a condition of about 1e3.
  for (int k = 0; k < 3; ++k) {
    EXPECT_LT((reduced.segment<3>(3 * k) - without.segment<3>(3 * nodes[k])).norm(),
              1e-10 * without.norm());
    for (int j = 0; j < 3; ++j)
      EXPECT_LT((factor.compliance().block<3, 3>(3 * k, 3 * j) -
                 inverse.block<3, 3>(3 * nodes[k], 3 * nodes[j]))
                    .norm(),
                1e-10 * inverse.norm());
  }
  EXPECT_LT((factor.complete(f) - with).norm(), 1e-10 * with.norm());
  EXPECT_LT((factor.complete(f) - with).norm(), 1e-10 * with.norm());  // b is still there
  EXPECT_EQ(factor.indexOf(5), 1);
  EXPECT_EQ(factor.indexOf(6), -1);
}

// In single precision where that leaves the pivots what is asked of them: as A is, their rounding
// counts a few times.
TEST(CondensedFactor, IsAsExactAsAskedFor) {
  const DeformableBody body = smallBlock();
  const Vec b = Vec::LinSpaced(3 * body.nodeCount(), -1.0, 2.0), none = Vec::Zero(9);
  // Hardly held, the last pivots are small differences of large numbers: single precision would
  // lose them.
  for (const double inertia : {1e3, 1e-2}) {
    const BlockMatrix A = heldStiffness(body, inertia);
    CondensedFactor factor;
    ASSERT_TRUE(factor.update(A, {0, 5, 13}, 1e-4));
    factor.reduce(b);
    Vec back;
    A.multiply(factor.complete(none), back);
    EXPECT_LT((back - b).norm(), 1e-4 * b.norm()) << inertia;
    const bool single = (back - b).norm() > 1e-9 * b.norm();
    EXPECT_EQ(single, inertia > 1.0);
  }
}

TEST(CondensedFactor, SolvesWithoutChosenNodes) {
  const DeformableBody body = smallBlock();
  const BlockMatrix A = heldStiffness(body, 1e3);
  CondensedFactor factor;
  ASSERT_TRUE(factor.update(A, {}));
  EXPECT_EQ(factor.compliance().size(), 0);
  const Vec b = Vec::LinSpaced(3 * body.nodeCount(), -1.0, 2.0);
  EXPECT_EQ(factor.reduce(b).size(), 0);
  Vec back;
  A.multiply(factor.complete(Vec()), back);
  EXPECT_LT((back - b).norm(), 1e-10 * b.norm());  // round-off, as above
}

TEST(CondensedFactor, SaysThatAMatrixIsIndefinite) {
  FemOptions options;
  options.cell_size = 0.1;
  DeformableBody body(boxSurface({0.2, 0.2, 0.2}, 2), {1e5, 0.3, 1000.0, 0.0}, options);
  BlockMatrix A;
  body.model().hessian(body.positions(), Definiteness::kPositive, A);
  A.block(A.pattern->diagonal[7])(1, 1) = -1.0;
  CondensedFactor factor;
  for (const double tolerance : {0.0, 1e-3}) EXPECT_FALSE(factor.update(A, {0, 5}, tolerance));
}

TEST(RegionSelection, PixelChoosesTheVisibleSide) {
  const WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.2}, 4), {0, 0, 0.1});
  Region region;
  region.kind = RegionKind::kPixel;
  region.pixel = {319.5, 239.5};  // the middle of the face towards the camera, at y = -0.1
  region.radius = 0.06;
  const std::vector<int> vertices = selectVertices(scene, 0, region);
  EXPECT_FALSE(vertices.empty());
  for (const int v : vertices) EXPECT_NEAR(scene.objects[0].mesh.vertex(v).y(), -0.1, 1e-12);
}

TEST(RegionSelection, SaysWhatThePixelShows) {
  const WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.2}, 4), {0, 0, 0.1});
  Region region;
  region.kind = RegionKind::kPixel;
  region.pixel = {1, 1};
  try {
    selectVertices(scene, 0, region);
    FAIL() << "a pixel beside the object was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("shows no object"), std::string::npos);
  }
}

}  // namespace
}  // namespace calipso::fem

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
