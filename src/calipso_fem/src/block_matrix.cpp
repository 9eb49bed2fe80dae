#include "calipso_fem/block_matrix.hpp"

#include <algorithm>
#include <cassert>

#include "thread_team.hpp"

namespace calipso::fem {

int BlockPattern::tryFind(int i, int j) const {
  const auto begin = column.begin() + row_start[i], end = column.begin() + row_start[i + 1];
  const auto it = std::lower_bound(begin, end, j);
  return it != end && *it == j ? static_cast<int>(it - column.begin()) : -1;
}

int BlockPattern::find(int i, int j) const {
  const int k = tryFind(i, j);
  assert(k >= 0);
  return k;
}

std::shared_ptr<const BlockPattern> makeBlockPattern(const CellMatrix& cells, int nodes) {
  std::vector<std::vector<int>> neighbours(nodes);
  for (int i = 0; i < nodes; ++i) neighbours[i].push_back(i);
  for (int cell = 0; cell < cells.rows(); ++cell)
    for (int a = 0; a < cells.cols(); ++a)
      for (int b = 0; b < cells.cols(); ++b) neighbours[cells(cell, a)].push_back(cells(cell, b));

  auto pattern = std::make_shared<BlockPattern>();
  pattern->row_start.assign(1, 0);
  for (int i = 0; i < nodes; ++i) {
    auto& row = neighbours[i];
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    const int start = static_cast<int>(pattern->column.size());
    pattern->diagonal.push_back(
        start + static_cast<int>(std::lower_bound(row.begin(), row.end(), i) - row.begin()));
    pattern->column.insert(pattern->column.end(), row.begin(), row.end());
    pattern->row_start.push_back(static_cast<int>(pattern->column.size()));
    std::vector<int>().swap(row);
  }
  return pattern;
}

BlockMatrix::BlockMatrix(std::shared_ptr<const BlockPattern> p) : pattern(std::move(p)) {
  if (pattern) values.assign(9 * static_cast<std::size_t>(pattern->blockCount()), 0.0);
}

void BlockMatrix::setZero() { std::fill(values.begin(), values.end(), 0.0); }

void BlockMatrix::multiply(const Vec& x, Vec& y) const {
  const int n = pattern->rows();
  y.resize(3 * n);
  parallelFor(n, 200, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      double s0 = 0.0, s1 = 0.0, s2 = 0.0;
      for (int k = pattern->row_start[i]; k < pattern->row_start[i + 1]; ++k) {
        const double* a = values.data() + 9 * static_cast<std::size_t>(k);
        const double* v = x.data() + 3 * pattern->column[k];
        s0 += a[0] * v[0] + a[1] * v[1] + a[2] * v[2];
        s1 += a[3] * v[0] + a[4] * v[1] + a[5] * v[2];
        s2 += a[6] * v[0] + a[7] * v[1] + a[8] * v[2];
      }
      y[3 * i] = s0;
      y[3 * i + 1] = s1;
      y[3 * i + 2] = s2;
    }
  });
}

void BlockMatrix::combine(double a, double b, const BlockMatrix& other) {
  assert(pattern == other.pattern);
  parallelFor(pattern->blockCount(), 4096, [&](int begin, int end) {
    for (long k = 9L * begin; k < 9L * end; ++k) values[k] = a * values[k] + b * other.values[k];
  });
}

Eigen::SparseMatrix<double> BlockMatrix::toSparse() const {
  const int n = pattern->rows();
  Eigen::SparseMatrix<double> A(3 * n, 3 * n);
  A.resizeNonZeros(static_cast<Eigen::Index>(values.size()));
  int* outer = A.outerIndexPtr();
  int* inner = A.innerIndexPtr();
  double* value = A.valuePtr();
  int next = 0;
  // The matrix is symmetric, so that block row i read across gives column block i.
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) {
      outer[3 * i + c] = next;
      for (int k = pattern->row_start[i]; k < pattern->row_start[i + 1]; ++k)
        for (int d = 0; d < 3; ++d) {
          inner[next] = 3 * pattern->column[k] + d;
          value[next++] = values[9 * static_cast<std::size_t>(k) + 3 * c + d];
        }
    }
  outer[3 * n] = next;
  return A;
}

}  // namespace calipso::fem
