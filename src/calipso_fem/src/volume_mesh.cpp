#include "calipso_fem/volume_mesh.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace calipso::fem {
namespace {

// Corner triples of the Kuhn split; with corner 0 and 7 they make six positively oriented
// tetrahedra.
constexpr int kKuhn[6][4] = {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7},
                             {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 6, 4, 7}};

}  // namespace

VolumeMesh boxMesh(const Eigen::Vector3d& min, const Eigen::Vector3d& max,
                   const Eigen::Vector3i& count) {
  if ((count.array() < 1).any() || !((max - min).array() > 0.0).all())
    throw std::invalid_argument("boxMesh: needs max > min and at least one cell along each axis");
  const Eigen::Vector3i n = count.array() + 1;
  VolumeMesh mesh;
  mesh.nodes.resize(static_cast<Eigen::Index>(n.x()) * n.y() * n.z(), 3);
  mesh.lattice.resize(mesh.nodes.rows(), 3);
  const auto id = [&n](int i, int j, int k) { return i + n.x() * (j + n.y() * k); };
  for (int k = 0; k < n.z(); ++k)
    for (int j = 0; j < n.y(); ++j)
      for (int i = 0; i < n.x(); ++i) {
        const Eigen::Vector3d t(double(i) / count.x(), double(j) / count.y(),
                                double(k) / count.z());
        mesh.nodes.row(id(i, j, k)) = (min + t.cwiseProduct(max - min)).transpose();
        mesh.lattice.row(id(i, j, k)) << i, j, k;
      }
  mesh.cells.resize(count.prod(), 8);
  int cell = 0;
  for (int k = 0; k < count.z(); ++k)
    for (int j = 0; j < count.y(); ++j)
      for (int i = 0; i < count.x(); ++i, ++cell)
        for (int c = 0; c < 8; ++c)
          mesh.cells(cell, c) = id(i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2));
  mesh.fraction = Eigen::VectorXd::Ones(mesh.cells.rows());
  return mesh;
}

void gradeBox(int axis, GradedEnds ends, VolumeMesh* box) {
  const auto drawn = [](double t) { return t * std::sqrt(t); };
  const double low = box->nodes.col(axis).minCoeff();
  const double side = box->nodes.col(axis).maxCoeff() - low;
  for (double& x : box->nodes.col(axis)) {
    const double t = (x - low) / side;
    const double graded = ends == GradedEnds::kLow ? drawn(t)
                          : t < 0.5                ? 0.5 * drawn(2.0 * t)
                                                   : 1.0 - 0.5 * drawn(2.0 * (1.0 - t));
    x = low + side * graded;
  }
}

VolumeMesh kuhnSplit(const VolumeMesh& hexes) {
  if (hexes.isTetrahedral())
    throw std::invalid_argument("kuhnSplit: the mesh already consists of tetrahedra");
  VolumeMesh tets = hexes;
  tets.cells.resize(6 * hexes.cells.rows(), 4);
  tets.fraction.resize(tets.cells.rows());
  tets.point_share.resize(0, 8);
  for (int cell = 0; cell < hexes.cellCount(); ++cell)
    for (int t = 0; t < 6; ++t) {
      for (int c = 0; c < 4; ++c) tets.cells(6 * cell + t, c) = hexes.cells(cell, kKuhn[t][c]);
      tets.fraction[6 * cell + t] = hexes.fraction[cell];
    }
  return tets;
}

Vec restPositions(const VolumeMesh& mesh) {
  return Eigen::Map<const Vec>(mesh.nodes.data(), 3 * mesh.nodes.rows());
}

void validate(const VolumeMesh& mesh) {
  const auto fail = [](const std::string& what) {
    throw std::invalid_argument("volume mesh: " + what);
  };
  if (mesh.nodes.rows() == 0 || mesh.cells.rows() == 0) fail("has no nodes or no cells");
  if (mesh.cells.cols() != 8 && mesh.cells.cols() != 4)
    fail("cells need 8 or 4 corners, not " + std::to_string(mesh.cells.cols()));
  if (!mesh.nodes.allFinite()) fail("a node position is not finite");
  if (mesh.fraction.size() != mesh.cells.rows()) fail("needs one filled fraction per cell");
  if (mesh.point_share.rows() != 0 &&
      (mesh.point_share.rows() != mesh.cells.rows() || !(mesh.point_share.minCoeff() > 0.0)))
    fail("needs a positive point share for every cell, or none");
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    if (mesh.cells.row(cell).minCoeff() < 0 || mesh.cells.row(cell).maxCoeff() >= mesh.nodeCount())
      fail("cell " + std::to_string(cell) + " names a node outside 0.." +
           std::to_string(mesh.nodeCount() - 1));
    if (!(mesh.fraction[cell] > 0.0 && mesh.fraction[cell] <= 1.0))
      fail("filled fraction of cell " + std::to_string(cell) + " is " +
           std::to_string(mesh.fraction[cell]) + ", allowed is (0, 1]");
  }
}

}  // namespace calipso::fem
