#pragma once

#include <Eigen/Core>
#include <vector>

#include "voxel_cells.hpp"

namespace calipso::fem {

// Which sub-voxels of a grid lie in the solid.
struct Occupancy {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  std::vector<bool> bits;

  Occupancy() = default;
  explicit Occupancy(const Eigen::Vector3i& s)
      : size(s), bits(s.cast<std::size_t>().prod(), false) {}
  std::size_t index(int i, int j, int k) const {
    return i + static_cast<std::size_t>(size.x()) * (j + static_cast<std::size_t>(size.y()) * k);
  }
  void set(int i, int j, int k) { bits[index(i, j, k)] = true; }
  bool get(int i, int j, int k) const { return bits[index(i, j, k)]; }
};

// Splits cells in which the solid falls into parts (face-connected sub-voxels, `s` per cell edge)
// into one cell per part, and notes which parts of neighbouring cells touch. `separate` false:
// parts stay together. Either way notes how each cell's filling is spread over its octants.
std::vector<CoveredCell> separateBranches(const std::vector<CoveredCell>& cells,
                                          const Occupancy& occupancy, int s, bool separate);

}  // namespace calipso::fem
