#pragma once

#include <memory>
#include <vector>

#include "calipso_fem/block_matrix.hpp"

namespace calipso::fem {

using LatticeMatrix = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Trilinear interpolation from the lattice of even nodes to a lattice twice as fine: x_f = P x_c.
// Weights 1, 1/2, 1/4 or 1/8, the same for the three components.
struct GridTransfer {
  struct Entry {
    int node;
    float weight;  // exact: a power of two
  };
  std::vector<int> parent_start, child_start;
  std::vector<Entry> parents;   // of each fine node: coarse nodes
  std::vector<Entry> children;  // of each coarse node: fine nodes, ascending
  LatticeMatrix coarse_lattice;

  int fineCount() const { return static_cast<int>(parent_start.size()) - 1; }
  int coarseCount() const { return static_cast<int>(child_start.size()) - 1; }
};

// Ids of the points of a lattice of the given size; -1: none.
class LatticeIndex {
 public:
  explicit LatticeIndex(const Eigen::RowVector3i& size);
  int& at(int x, int y, int z) {
    return id_[x +
               static_cast<std::size_t>(size_.x()) * (y + static_cast<std::size_t>(size_.y()) * z)];
  }
  std::vector<int>& all() { return id_; }  // x runs fastest, then y
  const Eigen::RowVector3i& size() const { return size_; }

 private:
  Eigen::RowVector3i size_;
  std::vector<int> id_;
};

// @pre no coordinate is negative
GridTransfer makeGridTransfer(const LatticeMatrix& fine_lattice);

// Pattern of P^T A P.
std::shared_ptr<const BlockPattern> coarsePattern(const BlockPattern& fine,
                                                  const GridTransfer& transfer);

// Ac = P^T A P, without the components that `free` (3 per fine node) marks as zero.
void galerkin(const BlockMatrix& A, const GridTransfer& transfer, const Vec& free, BlockMatrix* Ac);

}  // namespace calipso::fem
