#include "calipso_fem/embedding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <unordered_map>

namespace calipso::fem {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Cells by lattice position; several where branches are separated.
class CellFinder {
 public:
  explicit CellFinder(const VoxelGrid& grid) : grid_(grid) {
    for (int c = 0; c < grid.cellCount(); ++c)
      cells_[key(grid.cell_lattice.row(c).transpose())].push_back(c);
  }

  // The cell around a point given in lattice units; else the nearest one.
  int find(const Vector3d& p) const {
    const Vector3i cell = p.array().floor().cast<int>();
    if (const auto it = cells_.find(key(cell)); it != cells_.end()) return fullest(it->second);
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int reach = 1; reach <= 2 && best < 0; ++reach)
      best = nearestWithin(p, cell, reach, &least);
    for (int c = 0; best < 0 && c < grid_.cellCount(); ++c)
      if (const double d = squaredDistance(p, c); d < least) least = d, nearest_ = c;
    return best >= 0 ? best : nearest_;
  }

 private:
  static long key(const Vector3i& p) {
    return (static_cast<long>(p.x()) * 2097143 + p.y()) * 2097143 + p.z();
  }

  double squaredDistance(const Vector3d& p, int cell) const {
    const Vector3d low = grid_.cell_lattice.row(cell).transpose().cast<double>();
    return (p - p.cwiseMax(low).cwiseMin(low + Vector3d::Ones())).squaredNorm();
  }

  int fullest(const std::vector<int>& cells) const {
    return *std::max_element(cells.begin(), cells.end(), [this](int a, int b) {
      return grid_.fraction[a] < grid_.fraction[b];
    });
  }

  int nearestWithin(const Vector3d& p, const Vector3i& center, int reach, double* least) const {
    int best = -1;
    for (int dz = -reach; dz <= reach; ++dz)
      for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx) {
          const auto it = cells_.find(key(center + Vector3i(dx, dy, dz)));
          if (it == cells_.end()) continue;
          const int c = fullest(it->second);
          if (const double d = squaredDistance(p, c); d < *least) *least = d, best = c;
        }
    return best;
  }

  const VoxelGrid& grid_;
  std::unordered_map<long, std::vector<int>> cells_;
  mutable int nearest_ = 0;
};

}  // namespace

Embedding embed(const NodeMatrix& points, const VoxelGrid& grid) {
  if (grid.cellCount() == 0) throw std::invalid_argument("embed: the grid has no cells");
  const CellFinder finder(grid);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(8 * points.rows());
  for (int v = 0; v < points.rows(); ++v) {
    const Vector3d p = (points.row(v).transpose() - grid.origin) / grid.cell_size;
    const int cell = finder.find(p);
    const Vector3d t = p - grid.cell_lattice.row(cell).transpose().cast<double>();
    for (int c = 0; c < 8; ++c) {
      const double w = ((c & 1) ? t.x() : 1.0 - t.x()) * ((c & 2) ? t.y() : 1.0 - t.y()) *
                       ((c & 4) ? t.z() : 1.0 - t.z());
      if (w != 0.0) entries.emplace_back(v, grid.hexes(cell, c), w);
    }
  }
  Embedding embedding;
  embedding.weights.resize(points.rows(), grid.nodeCount());
  embedding.weights.setFromTriplets(entries.begin(), entries.end());
  return embedding;
}

Eigen::VectorXd Embedding::apply(const Eigen::VectorXd& nodal) const {
  Eigen::VectorXd surface(3 * vertexCount());
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  Eigen::Map<Rows>(surface.data(), vertexCount(), 3) =
      weights * Eigen::Map<const Rows>(nodal.data(), nodeCount(), 3);
  return surface;
}

Eigen::VectorXd Embedding::applyTransposed(const Eigen::VectorXd& surface) const {
  Eigen::VectorXd nodal(3 * nodeCount());
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  Eigen::Map<Rows>(nodal.data(), nodeCount(), 3) =
      weights.transpose() * Eigen::Map<const Rows>(surface.data(), vertexCount(), 3);
  return nodal;
}

Eigen::SparseVector<double> Embedding::pointWeights(const SurfacePoint& point) const {
  Eigen::SparseVector<double> result(nodeCount());
  for (int c = 0; c < 3; ++c) {
    if (point.weights[c] == 0.0) continue;
    if (point.vertices[c] < 0 || point.vertices[c] >= vertexCount())
      throw std::invalid_argument("surface point: vertex " + std::to_string(point.vertices[c]) +
                                  " does not exist, there are " + std::to_string(vertexCount()));
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(weights, point.vertices[c]);
         it; ++it)
      result.coeffRef(it.index()) += point.weights[c] * it.value();
  }
  return result;
}

}  // namespace calipso::fem
