#include "calipso_flow/wind_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace calipso::flow {
namespace {

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

// A curtain bent round a vertical axis, 0.6 m high, held along its upper edge: its normals differ, so
// that wind from the side is seen as well. Two faces, 8 mm apart.
ObjectModel curtain() {
  constexpr int kAcross = 8, kDown = 6;
  constexpr double kHalfAngle = 0.9, kRadius = 0.35, kThickness = 0.008;
  ObjectModel model;
  model.name = "curtain";
  const int face = (kAcross + 1) * (kDown + 1);
  model.mesh.vertices.resize(2 * face, 3);
  const auto id = [&](int side, int i, int j) { return side * face + j * (kAcross + 1) + i; };
  for (int side = 0; side < 2; ++side) {
    const double r = kRadius + (side == 0 ? 0.0 : kThickness);
    for (int j = 0; j <= kDown; ++j) {
      for (int i = 0; i <= kAcross; ++i) {
        const double angle = kHalfAngle * (2.0 * i / kAcross - 1.0);
        model.mesh.vertices.row(id(side, i, j)) << r * std::sin(angle), r * std::cos(angle),
            -0.1 * j;
      }
    }
  }
  std::vector<Eigen::Vector3i> triangles;
  const auto quad = [&](int a, int b, int c, int d) {
    triangles.emplace_back(a, b, c);
    triangles.emplace_back(a, c, d);
  };
  for (int j = 0; j < kDown; ++j) {
    for (int i = 0; i < kAcross; ++i) {
      quad(id(0, i, j), id(0, i + 1, j), id(0, i + 1, j + 1), id(0, i, j + 1));
      quad(id(1, i, j), id(1, i, j + 1), id(1, i + 1, j + 1), id(1, i + 1, j));
    }
  }
  for (int i = 0; i < kAcross; ++i) {
    quad(id(0, i, 0), id(1, i, 0), id(1, i + 1, 0), id(0, i + 1, 0));
    quad(id(0, i, kDown), id(0, i + 1, kDown), id(1, i + 1, kDown), id(1, i, kDown));
  }
  for (int j = 0; j < kDown; ++j) {
    quad(id(0, 0, j), id(0, 0, j + 1), id(1, 0, j + 1), id(1, 0, j));
    quad(id(0, kAcross, j), id(1, kAcross, j), id(1, kAcross, j + 1), id(0, kAcross, j + 1));
  }
  model.mesh.triangles.resize(triangles.size(), 3);
  for (size_t t = 0; t < triangles.size(); ++t) {
    model.mesh.triangles.row(t) = triangles[t].transpose();
  }
  model.world_from_object.translation() << 0.2, 0.1, 1.8;
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i <= kAcross; ++i) model.attached.push_back(id(side, i, 0));
  }
  return model;
}

TEST(WindFit, forceOfAFlatSheetIsItsPressure) {
  ObjectModel model = curtain();
  TriangleMesh mesh;  // one open square metre in the plane y = 0
  mesh.vertices.resize(4, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  const ClothSimulation::Vertices still = ClothSimulation::Vertices::Zero(4, 3);
  const auto forces = windForces(mesh, mesh.vertices, still, {2.0, 3.0, 0.0}, dragOf(mesh));
  // rho C A (w.n)^2 / 2 = 1.2 * 9 / 2; the wind along the sheet does nothing.
  EXPECT_NEAR(forces.col(1).sum(), 5.4, 1e-12);
  EXPECT_NEAR(forces.col(0).sum(), 0.0, 1e-12);
  // A closed sheet has two faces, each of which takes half.
  EXPECT_EQ(dragOf(model.mesh), 0.5 * dragOf(mesh));
  // Carried along with the wind it feels none.
  ClothSimulation::Vertices carried = still;
  carried.rowwise() += Eigen::RowVector3d(2.0, 3.0, 0.0);
  EXPECT_LT(windForces(mesh, mesh.vertices, carried, {2.0, 3.0, 0.0}, 1.2).norm(), 1e-12);
}

TEST(WindFit, refusesWhatNothingHolds) {
  ObjectModel model = curtain();
  model.attached.clear();
  EXPECT_THROW(ClothSimulation(model, kGravity), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::flow
