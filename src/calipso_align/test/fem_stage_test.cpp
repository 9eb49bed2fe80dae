#include "calipso_align/fem_stage.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "synthetic_shape.hpp"

extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));
extern "C" int openblas_get_num_threads() __attribute__((weak));

namespace calipso::align {
namespace {

constexpr int kNodes = 200;

const auto kAsItIs = [](const Points& points) { return points; };

FemStageOptions options() {
  FemStageOptions result;
  result.nodes = kNodes;
  result.elastic_weights.assign(6, 1e2);
  result.hold_depth = true;
  return result;
}

// The pear and a copy of it beside.
TriangleMesh twoPieces() {
  const TriangleMesh pear = test::pear();
  TriangleMesh both;
  both.vertices.resize(2 * pear.vertexCount(), 3);
  both.vertices << pear.vertices, pear.vertices.rowwise() + Eigen::RowVector3d(2.0, 0.0, 0.0);
  both.triangles.resize(2 * pear.triangleCount(), 3);
  both.triangles << pear.triangles, (pear.triangles.array() + pear.vertexCount()).matrix();
  return both;
}

// Pulls the first `count` vertices `by` metres along x from where they are drawn.
Rows pull(const TriangleMesh& mesh, const Points& x, int count, double by, double weight) {
  Rows rows;
  for (int i = 0; i < count; ++i) {
    rows.push_back(
        vertexRow(i, Eigen::Vector3d::UnitX(), x(i, 0) - mesh.vertices(i, 0) - by, weight));
  }
  return rows;
}

TEST(ElasticFit, APieceThatNothingPullsStaysWhereItIs) {
  const TriangleMesh mesh = twoPieces();
  const int half = mesh.vertexCount() / 2;
  ElasticFit fit(mesh, gridOf(mesh, kNodes), kAsItIs, options());
  const FemStageReport report =
      fit.fit([&](const Points& x, int) { return pull(mesh, x, half, 0.1, 1e4); });
  EXPECT_TRUE(report.solvable);
  EXPECT_EQ(report.damped, 0);
  const Points moved = fit.vertices() - mesh.vertices;
  // A translation costs the first piece nothing but the drift term, which is weaker by far.
  EXPECT_NEAR(moved.topRows(half).col(0).mean(), 0.1, 1e-4);
  EXPECT_LT(moved.bottomRows(half).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(ElasticFit, AnIndefiniteSystemIsStiffenedAndReported) {
  const TriangleMesh mesh = test::pear();
  ElasticFit fit(mesh, gridOf(mesh, kNodes), kAsItIs, options());
  // Measurements of negative weight push away: their Hessian has a negative eigenvalue.
  const FemStageReport report =
      fit.fit([&](const Points& x, int) { return pull(mesh, x, 1, 0.0, -10.0); });
  EXPECT_TRUE(report.solvable);
  EXPECT_GT(report.damped, 0);
  EXPECT_TRUE(fit.vertices().allFinite());
}

TEST(ElasticFit, AMeasurementThatIsNoNumberIsReported) {
  const TriangleMesh mesh = test::pear();
  ElasticFit fit(mesh, gridOf(mesh, kNodes), kAsItIs, options());
  const FemStageReport report =
      fit.fit([&](const Points& x, int) { return pull(mesh, x, 10, 0.1, std::nan("")); });
  EXPECT_FALSE(report.solvable);
  EXPECT_TRUE(fit.vertices().isApprox(mesh.vertices, 1e-9));  // where it was put
}

// With as many as there are processors, the same clip gives other models on another machine.
TEST(ElasticFit, BlasHasOneThread) {
  if (!openblas_set_num_threads) GTEST_SKIP() << "CHOLMOD stands on another BLAS than OpenBLAS";
  openblas_set_num_threads(2);
  const TriangleMesh mesh = test::pear();
  ElasticFit fit(mesh, gridOf(mesh, kNodes), kAsItIs, options());
  EXPECT_EQ(openblas_get_num_threads(), 1);
}

TEST(ElasticFit, RejectsABodyWithoutVolume) {
  const TriangleMesh mesh = test::pear();
  const auto flat = [](const Points& points) {
    Points x = points;
    x.col(1).setZero();
    return x;
  };
  EXPECT_THROW(ElasticFit(mesh, gridOf(mesh, kNodes), flat, options()), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::align
