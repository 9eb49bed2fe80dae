#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <vector>

#include "calipso_fem/volume_mesh.hpp"

namespace calipso::fem {

// Which 3x3 blocks of a symmetric matrix are stored: those of every pair of nodes that share a
// cell. Columns of a row ascend.
struct BlockPattern {
  std::vector<int> row_start;  // #N + 1
  std::vector<int> column;     // #blocks
  std::vector<int> diagonal;   // #N, index of block (i, i)

  int rows() const { return static_cast<int>(row_start.size()) - 1; }
  int blockCount() const { return static_cast<int>(column.size()); }
  // Index of block (i, j). @pre the pair is in the pattern
  int find(int i, int j) const;
  // The same, or -1 for a pair that is not in the pattern.
  int tryFind(int i, int j) const;
};

std::shared_ptr<const BlockPattern> makeBlockPattern(const CellMatrix& cells, int nodes);

// A symmetric matrix of 3x3 blocks (row-major inside) in compressed rows. Both halves are stored.
struct BlockMatrix {
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<double> values;  // 9 per block

  explicit BlockMatrix(std::shared_ptr<const BlockPattern> p = nullptr);

  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> block(int k) {
    return Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data() + 9 * k);
  }
  Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> block(int k) const {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data() + 9 * k);
  }

  void setZero();
  // y = A x
  void multiply(const Vec& x, Vec& y) const;
  // this = a * this + b * other; both on the same pattern
  void combine(double a, double b, const BlockMatrix& other);
  // 3n x 3n, both halves
  Eigen::SparseMatrix<double> toSparse() const;
};

}  // namespace calipso::fem
