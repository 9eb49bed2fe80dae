#include "calipso_align/shape_uncertainty.hpp"

#include <gtest/gtest.h>

#include "calipso_align/schedule.hpp"
#include "calipso_align/surface_distance.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

constexpr double kRadius = 1.0, kDiagonal = 2.0;

// A sphere 20 m in front of the camera.
TriangleMesh sphere() {
  TriangleMesh mesh = test::pear(30, 40);
  mesh.vertices = kRadius * mesh.vertices.rowwise().normalized();
  mesh.vertices.col(2).array() += 20.0;
  return mesh;
}

Eigen::MatrixXd depthCovariance(double deviation) {
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(LowOrderMap::kParameters, LowOrderMap::kParameters);
  C(LowOrderMap::kTranslation + 2, LowOrderMap::kTranslation + 2) = deviation * deviation;
  return C;
}

ShapeUncertainty ofSphere(double deviation,
                          const std::function<double(const LowOrderMap::Parameters&)>& likelihood) {
  const TriangleMesh mesh = sphere();
  return shapeUncertainty(mesh.vertices, mesh.triangles, LowOrderMap(mesh.vertices),
                          depthCovariance(deviation), kDiagonal, 0.0, likelihood);
}

double anything(const LowOrderMap::Parameters&) { return 1.0; }

// A sphere shifted by d is off by |d cos| over itself: d / 2 on average, d / sqrt(3) r.m.s.; the
// mean size of a normally distributed shift is sqrt(2 / pi) of its deviation.
TEST(ShapeUncertainty, OfAShiftedSphereIsHalfItsShift) {
  constexpr double kDeviation = 0.1;
  const SurfaceDistance expected = ofSphere(kDeviation, anything).expected();
  // 64 draws place the mean of a normal variable's size to 9.4 %, its r.m.s. to 8.8 %: two
  // deviations.
  EXPECT_NEAR(expected.mean * kDiagonal, 0.5 * std::sqrt(2.0 / M_PI) * kDeviation, 0.0075);
  EXPECT_NEAR(expected.rms * kDiagonal, kDeviation / std::sqrt(3.0), 0.0102);
}

// 20 m away, a sphere shifted by d is off by d / 2, but in the picture only shrinks by d / 20.
TEST(ShapeUncertainty, AShiftAlongTheSightLineIsNearlyAllDistance) {
  const ShapeUncertainty error = ofSphere(0.1, anything);
  const SurfaceDistance limit{0.015 / kDiagonal, 1.0};  // half of 0.03, a twentieth of 0.3
  EXPECT_GT(error.beyond(limit), 0.6);
  EXPECT_LT(error.shapeBeyond(limit), 0.05);
}

TEST(ShapeUncertainty, LeavesOutWhatIsImpossible) {
  constexpr double kMost = 0.05;
  const auto bounded = [](const LowOrderMap::Parameters& step) {
    return std::abs(step[LowOrderMap::kTranslation + 2]) <= kMost ? 1.0 : 0.0;
  };
  const ShapeUncertainty error = ofSphere(0.1, bounded);
  ASSERT_FALSE(error.draws.empty());
  // 20 points of each draw see its mean to some 15 %.
  EXPECT_EQ(error.beyond({1.5 * 0.5 * kMost / kDiagonal, 1.0}), 0.0);
  EXPECT_GT(error.beyond({0.1 * kMost / kDiagonal, 1.0}), 0.5);
}

TEST(ShapeUncertainty, WhatContradictsEverythingMayBeAnywhere) {
  const auto nothing = [](const LowOrderMap::Parameters&) { return 0.0; };
  EXPECT_EQ(ofSphere(0.1, nothing).beyond({0.04, 0.06}), 1.0);
}

TEST(ShapeUncertainty, CountsWhatIsLikely) {
  // Shifts beyond 0.1 m, a third of all, are made a hundred times as likely.
  const auto far = [](const LowOrderMap::Parameters& step) {
    return std::abs(step[LowOrderMap::kTranslation + 2]) > 0.1 ? 100.0 : 1.0;
  };
  const SurfaceDistance limit{0.04 / kDiagonal, 1.0};
  EXPECT_LT(ofSphere(0.1, anything).beyond(limit), 0.6);
  EXPECT_GT(ofSphere(0.1, far).beyond(limit), 0.95);
  EXPECT_EQ(ofSphere(0.0, anything).beyond(limit), 0.0);
}

TEST(DistancesToSurface, AreThoseOfTheNearestFace) {
  const TriangleMesh mesh = test::pear();
  Points from = 1.5 * mesh.vertices;
  const std::vector<double> all = distancesToSurface(from, mesh.vertices, mesh.triangles);
  for (int i = 0; i < from.rows(); i += 17) {
    double least = 1e9;  // face by face
    for (int f = 0; f < mesh.triangleCount(); ++f) {
      least =
          std::min(least, distancesToSurface(from.row(i), mesh.vertices, mesh.triangles.row(f))[0]);
    }
    EXPECT_DOUBLE_EQ(all[i], least);
  }
}

TEST(PlacementPrior, WhatIsOffAcrossLeavesLessAlong) {
  const Eigen::Vector3d found(0.0, 0.0, 2.0);
  const auto along = [&](double across, double depth) {
    const Eigen::Vector3d placed(across * 2.0, 0.0, 2.0);
    return PlacementPrior(placed, found).density(found + Eigen::Vector3d(0.0, 0.0, depth * 2.0));
  };
  EXPECT_GT(along(0.0, 0.045), 0.0);
  EXPECT_EQ(along(0.0, 0.055), 0.0);   // further than a placement may be off
  EXPECT_EQ(along(0.04, 0.045), 0.0);  // 0.03 remain
  EXPECT_GT(along(0.04, 0.025), 0.0);
  EXPECT_GT(along(0.08, 0.06), 0.0);  // across, the bound was not kept
  EXPECT_GT(along(0.0, 0.01), along(0.0, 0.04));
  // Measured at more than the bound away: there it may be.
  EXPECT_GT(PlacementPrior({0.0, 0.0, 2.0}, {0.0, 0.0, 2.2}).density({0.0, 0.0, 2.2}), 0.0);
}

}  // namespace
}  // namespace calipso::align
