#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "calipso_fem/voxel_grid.hpp"

namespace calipso::fem {

// A point of a surface: a weighted mean of up to three of its vertices.
struct SurfacePoint {
  Eigen::Vector3i vertices = Eigen::Vector3i::Zero();
  Eigen::Vector3d weights = Eigen::Vector3d::UnitX();

  static SurfacePoint vertex(int i) { return {{i, i, i}, Eigen::Vector3d::UnitX()}; }
  static SurfacePoint onTriangle(const Eigen::Vector3i& corners,
                                 const Eigen::Vector3d& barycentric) {
    return {corners, barycentric};
  }
};

// Surface vertices carried by a grid: x_s = J x_u, f_u = J^T f_s, so that power is conserved:
// v_s . f_s = v_u . f_u (paper, section 4.2). Trilinear weights, eight nodes per vertex.
struct Embedding {
  // #V x #N scalar weights; the same for all three components.
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights;

  int vertexCount() const { return static_cast<int>(weights.rows()); }
  int nodeCount() const { return static_cast<int>(weights.cols()); }

  // J x: nodal vector (3 #N) to surface vector (3 #V).
  Eigen::VectorXd apply(const Eigen::VectorXd& nodal) const;
  // J^T f: surface vector (3 #V) to nodal vector (3 #N).
  Eigen::VectorXd applyTransposed(const Eigen::VectorXd& surface) const;
  // Weights of one surface point on the nodes.
  Eigen::SparseVector<double> pointWeights(const SurfacePoint& point) const;
};

// Weights of given points (#V x 3, m, frame of the grid) in their cells; a point outside of every
// cell is carried by the nearest one. @throw std::invalid_argument for a grid without cells
Embedding embed(const NodeMatrix& points, const VoxelGrid& grid);

}  // namespace calipso::fem
