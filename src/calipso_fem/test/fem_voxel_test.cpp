#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "append_box.hpp"
#include "calipso_fem/embedding.hpp"
#include "calipso_fem/voxel_grid.hpp"

namespace calipso::fem {
namespace {

double filledVolume(const VoxelGrid& grid) {
  return grid.fraction.sum() * std::pow(grid.cell_size, 3);
}

TEST(GradedBox, KeepsItsSidesAndGetsFinerTowardsItsEnds) {
  VolumeMesh low = boxMesh({1, 0, 0}, {3, 1, 1}, {8, 1, 1}), both = low;
  gradeBox(0, GradedEnds::kLow, &low);
  gradeBox(0, GradedEnds::kBoth, &both);
  for (int i = 0; i <= 8; ++i) {
    EXPECT_NEAR(low.nodes(i, 0), 1.0 + 2.0 * std::pow(i / 8.0, 1.5), 1e-14);
    EXPECT_NEAR(both.nodes(i, 0) - 1.0, 3.0 - both.nodes(8 - i, 0), 1e-14);  // symmetric
  }
  EXPECT_NEAR(both.nodes(1, 0), 1.0 + std::pow(0.25, 1.5), 1e-14);
  EXPECT_EQ(low.nodes(0, 1), 0.0);
}

TEST(Voxelize, AlignedBoxIsExact) {
  TriangleMesh mesh;
  appendBox({0, 0, 0}, {1.0, 0.5, 0.25}, &mesh);
  VoxelizeOptions options;
  options.cell_size = 0.125;
  const VoxelGrid grid = voxelize(mesh, options);
  EXPECT_EQ(grid.cellCount(), 8 * 4 * 2);
  EXPECT_EQ(grid.nodeCount(), 9 * 5 * 3);
  EXPECT_NEAR(grid.fraction.minCoeff(), 1.0, 1e-12);
  EXPECT_TRUE(grid.messages.empty());
}

TEST(Voxelize, CutCellsCarryTheirShare) {
  TriangleMesh mesh;
  appendBox({0.03, -0.01, 0.02}, {0.97, 0.49, 0.33}, &mesh);
  VoxelizeOptions options;
  options.cell_size = 0.1;
  options.has_anchor = true;
  const VoxelGrid grid = voxelize(mesh, options);
  EXPECT_NEAR(filledVolume(grid), 0.94 * 0.5 * 0.31, 0.005 * 0.94 * 0.5 * 0.31);
}

TEST(Voxelize, NodeCountFollowsTheTarget) {
  TriangleMesh mesh;
  appendBox({0, 0, 0}, {1.0, 0.8, 0.6}, &mesh);
  for (const int target : {200, 1000, 3000}) {
    VoxelizeOptions options;
    options.target_nodes = target;
    EXPECT_NEAR(voxelize(mesh, options).nodeCount() / double(target), 1.0, 0.25);
  }
}

TEST(Voxelize, OverlappingShellsAreOneSolidAndInwardFacesAreTurned) {
  TriangleMesh mesh;
  appendBox({0, 0, 0}, {1, 1, 1}, &mesh);
  appendBox({0.5, 0.2, 0.2}, {1.5, 0.8, 0.8}, &mesh);
  VoxelizeOptions options;
  options.cell_size = 0.1;
  const double volume = 1.0 + 0.5 * 0.36;
  EXPECT_NEAR(filledVolume(voxelize(mesh, options)), volume, 0.01 * volume);
  mesh.triangles.col(1).swap(mesh.triangles.col(2));
  const VoxelGrid turned = voxelize(mesh, options);
  EXPECT_NEAR(filledVolume(turned), volume, 0.01 * volume);
  ASSERT_FALSE(turned.messages.empty());
  EXPECT_NE(turned.messages[0].find("inwards"), std::string::npos);
}

TEST(Voxelize, OpenAndFlatMeshesAreCoveredWithAMessage) {
  TriangleMesh box;
  appendBox({0, 0, 0}, {1, 1, 1}, &box);
  TriangleMesh open = box;
  open.triangles = box.triangles.topRows(10).eval();
  VoxelizeOptions options;
  options.cell_size = 0.25;
  const VoxelGrid grid = voxelize(open, options);
  EXPECT_NEAR(filledVolume(grid), 1.0, 0.1);
  EXPECT_FALSE(grid.messages.empty());

  TriangleMesh sheet;
  sheet.vertices.resize(4, 3);
  sheet.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  sheet.triangles.resize(2, 3);
  sheet.triangles << 0, 1, 2, 0, 2, 3;
  const VoxelGrid flat = voxelize(sheet, options);
  EXPECT_GE(flat.cellCount(), 16);
  EXPECT_FALSE(flat.messages.empty());
}

TEST(Voxelize, FacesWithoutAreaAndCopiesAreLeftOutWithAMessage) {
  TriangleMesh clean;
  appendBox({0, 0, 0}, {1, 1, 1}, &clean);
  TriangleMesh mesh = clean;
  mesh.triangles.conservativeResize(16, 3);
  mesh.triangles.row(12) << 0, 0, 1;                          // a corner named twice
  mesh.triangles.row(13) = clean.triangles.row(3);            // a copy
  mesh.triangles.row(14) = clean.triangles.row(5).reverse();  // a copy turned round
  mesh.triangles.row(15) << 0, 7, 7;
  VoxelizeOptions options;
  options.cell_size = 0.25;
  const VoxelGrid grid = voxelize(mesh, options), expected = voxelize(clean, options);
  EXPECT_EQ(grid.cellCount(), expected.cellCount());
  EXPECT_LT((grid.fraction - expected.fraction).norm(), 1e-12);
  ASSERT_EQ(grid.messages.size(), 2u);
  EXPECT_EQ(grid.messages[0], "2 faces without area are left out");
  EXPECT_EQ(grid.messages[1], "2 faces that repeat another one are left out");
  mesh.triangles = mesh.triangles.bottomRows(1).eval();
  EXPECT_THROW(voxelize(mesh, options), std::invalid_argument);
}

// A plate far thinner than a cell: no cell centre and next to no volume lies inside.
TEST(Voxelize, PlateThinnerThanACellIsALayerOfCells) {
  TriangleMesh mesh;
  appendBox({0, 0, 0.1}, {1.0, 1.0, 0.101}, &mesh);
  VoxelizeOptions options;
  options.cell_size = 0.25;
  const VoxelGrid grid = voxelize(mesh, options);
  EXPECT_GE(grid.cellCount(), 16);
  EXPECT_GT(grid.fraction.minCoeff(), 0.0);
  ASSERT_FALSE(grid.messages.empty());
  EXPECT_NE(grid.messages.back().find("layer of surface cells"), std::string::npos);
}

TEST(Voxelize, BranchesThatShareACellAreNotWelded) {
  TriangleMesh mesh;
  // The gap is wider than a sixth of a cell, the spacing of the sight lines.
  appendBox({0.0, 0.0, 0.0}, {2.0, 0.40, 0.5}, &mesh);
  appendBox({0.0, 0.70, 0.0}, {2.0, 1.0, 0.5}, &mesh);
  VoxelizeOptions options;
  options.cell_size = 1.0;
  options.has_anchor = true;
  const VoxelGrid apart = voxelize(mesh, options);
  EXPECT_EQ(apart.cellCount(), 4);
  EXPECT_EQ(apart.nodeCount(), 24);
  options.separate_branches = false;
  EXPECT_EQ(voxelize(mesh, options).nodeCount(), 12);
}

// Its vertices would fall off as soon as the object can bend.
TEST(Voxelize, SmallPartsThatTouchNothingAreWelded) {
  const auto nodesWithBrick = [](double length) {
    TriangleMesh mesh;
    appendBox({0.0, 0.0, 0.0}, {length, 0.40, 0.5}, &mesh);
    appendBox({3.0, 0.70, 0.0}, {5.0, 1.0, 0.5}, &mesh);
    VoxelizeOptions options;
    options.cell_size = 1.0;
    options.has_anchor = true;
    return voxelize(mesh, options).nodeCount();
  };
  EXPECT_EQ(nodesWithBrick(120.0), 4 * 121);     // 2 of 122 cells
  EXPECT_EQ(nodesWithBrick(20.0), 4 * 21 + 12);  // 2 of 22: a part of its own
}

TEST(Embedding, ReproducesPointsAndSumsToOne) {
  TriangleMesh mesh;
  appendBox({0.1, 0.2, 0.3}, {1.0, 0.7, 0.8}, &mesh);
  VoxelizeOptions options;
  options.cell_size = 0.13;
  const VoxelGrid grid = voxelize(mesh, options);
  const Embedding embedding = embed(mesh.vertices, grid);
  const Eigen::VectorXd ones = embedding.weights * Eigen::VectorXd::Ones(grid.nodeCount());
  EXPECT_LT((ones.array() - 1.0).abs().maxCoeff(), 1e-12);
  EXPECT_LT((embedding.weights * grid.nodes - mesh.vertices).norm(), 1e-12);
}

TEST(Voxelize, RejectsBadInput) {
  TriangleMesh mesh;
  appendBox({0, 0, 0}, {1, 1, 1}, &mesh);
  VoxelizeOptions options;
  options.cell_size = -1.0;
  EXPECT_THROW(voxelize(mesh, options), std::invalid_argument);
  options.cell_size = 0.1;
  TriangleMesh bad = mesh;
  bad.vertices(0, 0) = std::nan("");
  EXPECT_THROW(voxelize(bad, options), std::invalid_argument);
  bad = mesh;
  bad.triangles(0, 0) = 99;
  EXPECT_THROW(voxelize(bad, options), std::invalid_argument);
  EXPECT_THROW(voxelize(TriangleMesh{}, options), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::fem
