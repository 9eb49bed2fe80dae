#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calipso_fem/voxel_grid.hpp"

namespace calipso::fem {

struct VoxelLayout {
  double cell_size = 0.0;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3i count = Eigen::Vector3i::Zero();  // cells along each axis

  int index(int i, int j, int k) const { return i + count.x() * (j + count.y() * k); }
};

// A cell of the grid. Cells at one position with different `branch` are parts that share the cell
// without touching.
struct CoveredCell {
  Eigen::Vector3i position = Eigen::Vector3i::Zero();
  int branch = 0;
  double fraction = 0.0;
  double share[8] = {1, 1, 1, 1, 1, 1, 1, 1};  // of the filled part in each octant, mean one
  // Branches of the neighbour across each face (-x, +x, -y, +y, -z, +z) that this part touches,
  // as a set of bits; all ones where nothing is known.
  unsigned neighbours[6] = {~0u, ~0u, ~0u, ~0u, ~0u, ~0u};
};

// Cells that the solid fills or its surface touches, in lattice order. Appends to `messages`.
std::vector<CoveredCell> coverSurface(const TriangleMesh& surface, const VoxelLayout& layout,
                                      const VoxelizeOptions& options,
                                      std::vector<std::string>* messages);

// Two cells that touch across face +axis of `low`.
struct FaceContact {
  int low = 0, high = 0, axis = 0;
};

std::vector<FaceContact> faceContacts(const std::vector<CoveredCell>& cells);

struct CornerNumbering {
  Eigen::Matrix<int, Eigen::Dynamic, 8, Eigen::RowMajor> hexes;
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> node_lattice;
};

// Joins the corners of face neighbours that touch, and numbers what remains in lattice order.
CornerNumbering numberCorners(const std::vector<CoveredCell>& cells);

}  // namespace calipso::fem
