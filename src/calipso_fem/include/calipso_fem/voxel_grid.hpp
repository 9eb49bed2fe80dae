#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calipso_fem/volume_mesh.hpp"
#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

// A sparse set of equal cubes that covers a surface, axis-aligned in the frame of that surface.
struct VoxelGrid {
  double cell_size = 0.0;                            // m
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // corner of lattice node (0, 0, 0), m
  NodeMatrix nodes;                                  // #N x 3, m
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> node_lattice;  // #N x 3
  Eigen::Matrix<int, Eigen::Dynamic, 8, Eigen::RowMajor> hexes;         // #C x 8, x fastest
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> cell_lattice;  // #C x 3
  Eigen::VectorXd fraction;           // #C, filled part, in (0, 1]
  PointMatrix point_share;            // #C x 8, as in VolumeMesh
  std::vector<std::string> messages;  // what had to be repaired, for the user

  int nodeCount() const { return static_cast<int>(nodes.rows()); }
  int cellCount() const { return static_cast<int>(hexes.rows()); }
  VolumeMesh mesh() const;
};

struct VoxelizeOptions {
  double cell_size = 0.0;  // m; 0: chosen so that about target_nodes result
  int target_nodes = 1500;
  int samples_per_edge = 6;       // sight lines per cell edge for the filled fraction
  double min_fraction = 1e-3;     // floor for cells that the surface only grazes
  bool separate_branches = true;  // parts that share a cell without touching are not welded
  // A lattice plane passes through this point (m) when set; else the grid is centred on the mesh.
  bool has_anchor = false;
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();
};

// Covers the volume inside a surface by cubes. Overlapping closed shells count as one solid. A mesh
// that is not closed, or encloses next to nothing, is covered by the cells its surface touches, and
// `messages` says so.
// @throw std::invalid_argument naming what is wrong with the mesh or the options
VoxelGrid voxelize(const TriangleMesh& surface, const VoxelizeOptions& options);

}  // namespace calipso::fem
