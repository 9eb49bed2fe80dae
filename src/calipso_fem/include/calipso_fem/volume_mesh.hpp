#pragma once

#include <Eigen/Core>

namespace calipso::fem {

// Nodal vectors hold 3n numbers, node by node: (x0, y0, z0, x1, ...).
using Vec = Eigen::VectorXd;
using NodeMatrix = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using PointMatrix = Eigen::Matrix<double, Eigen::Dynamic, 8, Eigen::RowMajor>;
using CellMatrix = Eigen::Matrix<int, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// A volume mesh of hexahedra (8 corners) or tetrahedra (4 corners).
// Hexahedron corner c = bx + 2 by + 4 bz lies at parent coordinates (2 bx - 1, 2 by - 1, 2 bz - 1).
struct VolumeMesh {
  NodeMatrix nodes;          // #N x 3, rest positions, m
  CellMatrix cells;          // #C x 8 or #C x 4
  Eigen::VectorXd fraction;  // #C, filled part of each cell, in (0, 1]
  // How the filled part of each hexahedron is spread over the octants around its Gauss points, mean
  // one per row; empty: evenly. #C x 8
  PointMatrix point_share;
  // Lattice coordinates of the nodes when they lie on a regular grid, else empty. #N x 3
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> lattice;

  int nodeCount() const { return static_cast<int>(nodes.rows()); }
  int cellCount() const { return static_cast<int>(cells.rows()); }
  bool isTetrahedral() const { return cells.cols() == 4; }
  Eigen::Vector3d node(int i) const { return nodes.row(i).transpose(); }
};

// A box [min, max] cut into count.x() x count.y() x count.z() hexahedra; node id =
// i + (nx + 1) (j + (ny + 1) k), cells in the same order. @throw std::invalid_argument
VolumeMesh boxMesh(const Eigen::Vector3d& min, const Eigen::Vector3d& max,
                   const Eigen::Vector3i& count);

// Draws the lattice planes of a box mesh along one axis towards its low end, or towards both:
// distances t from the end, as shares of the side (or of half of it), become t^1.5. The stress at a
// clamped edge grows like r^-0.3 to r^-0.4, and on such a grid (Babuska's radical mesh) that corner
// costs no more than the rest of the body.
enum class GradedEnds { kLow, kBoth };
void gradeBox(int axis, GradedEnds ends, VolumeMesh* box);

// Splits every hexahedron into six tetrahedra around its diagonal 0-7 (Kuhn), conforming between
// equally oriented neighbours. @throw std::invalid_argument when the mesh is not of hexahedra
VolumeMesh kuhnSplit(const VolumeMesh& hexes);

// 3n vector of the rest positions.
Vec restPositions(const VolumeMesh& mesh);

// @throw std::invalid_argument naming the cell or node that is wrong, and how
void validate(const VolumeMesh& mesh);

}  // namespace calipso::fem
