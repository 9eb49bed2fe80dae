#include "grid_transfer.hpp"

#include <algorithm>
#include <array>
#include <map>

namespace calipso::fem {
namespace {

using Key = std::array<int, 3>;  // z, y, x

// Coarse lattice positions around a fine one, and their common weight.
std::vector<Key> parentsOf(const Eigen::RowVector3i& p) {
  std::vector<Key> keys = {{0, 0, 0}};
  for (int axis = 0; axis < 3; ++axis) {
    const int low = p[axis] >> 1;
    const bool odd = p[axis] & 1;
    const std::size_t n = keys.size();
    for (std::size_t k = 0; k < n; ++k) {
      if (odd) {
        keys.push_back(keys[k]);
        keys.back()[2 - axis] = low + 1;
      }
      keys[k][2 - axis] = low;
    }
  }
  return keys;
}

}  // namespace

GridTransfer makeGridTransfer(const LatticeMatrix& fine_lattice) {
  const int n = static_cast<int>(fine_lattice.rows());
  std::map<Key, int> id;
  for (int i = 0; i < n; ++i)
    for (const Key& key : parentsOf(fine_lattice.row(i))) id[key] = 0;
  GridTransfer t;
  t.coarse_lattice.resize(id.size(), 3);
  int next = 0;
  for (auto& [key, node] : id) {
    t.coarse_lattice.row(next) << key[2], key[1], key[0];
    node = next++;
  }
  std::vector<std::vector<GridTransfer::Entry>> children(next);
  t.parent_start.push_back(0);
  for (int i = 0; i < n; ++i) {
    const std::vector<Key> keys = parentsOf(fine_lattice.row(i));
    for (const Key& key : keys) {
      t.parents.push_back({id[key], 1.0 / keys.size()});
      children[id[key]].push_back({i, 1.0 / keys.size()});
    }
    t.parent_start.push_back(static_cast<int>(t.parents.size()));
  }
  t.child_start.push_back(0);
  for (const auto& list : children) {
    t.children.insert(t.children.end(), list.begin(), list.end());
    t.child_start.push_back(static_cast<int>(t.children.size()));
  }
  return t;
}

void GridTransfer::prolongAdd(const Vec& coarse, Vec* fine) const {
  const int n = fineCount();
#pragma omp parallel for schedule(static)
  for (int i = 0; i < n; ++i)
    for (int k = parent_start[i]; k < parent_start[i + 1]; ++k)
      fine->segment<3>(3 * i) += parents[k].weight * coarse.segment<3>(3 * parents[k].node);
}

void GridTransfer::restrictTo(const Vec& fine, Vec* coarse) const {
  const int n = coarseCount();
  coarse->resize(3 * n);
#pragma omp parallel for schedule(static)
  for (int i = 0; i < n; ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = child_start[i]; k < child_start[i + 1]; ++k)
      sum += children[k].weight * fine.segment<3>(3 * children[k].node);
    coarse->segment<3>(3 * i) = sum;
  }
}

std::shared_ptr<const BlockPattern> coarsePattern(const BlockPattern& fine,
                                                  const GridTransfer& t) {
  auto pattern = std::make_shared<BlockPattern>();
  pattern->row_start.push_back(0);
  std::vector<int> row;
  for (int I = 0; I < t.coarseCount(); ++I) {
    row.clear();
    for (int c = t.child_start[I]; c < t.child_start[I + 1]; ++c) {
      const int i = t.children[c].node;
      for (int k = fine.row_start[i]; k < fine.row_start[i + 1]; ++k) {
        const int j = fine.column[k];
        for (int p = t.parent_start[j]; p < t.parent_start[j + 1]; ++p)
          row.push_back(t.parents[p].node);
      }
    }
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    const int start = pattern->row_start.back();
    pattern->diagonal.push_back(
        start + static_cast<int>(std::lower_bound(row.begin(), row.end(), I) - row.begin()));
    pattern->column.insert(pattern->column.end(), row.begin(), row.end());
    pattern->row_start.push_back(static_cast<int>(pattern->column.size()));
  }
  return pattern;
}

void galerkin(const BlockMatrix& A, const GridTransfer& t, const Vec& free, BlockMatrix* Ac) {
  const BlockPattern& fine = *A.pattern;
  const BlockPattern& coarse = *Ac->pattern;
  Ac->setZero();
  const int n = t.coarseCount();
#pragma omp parallel
  {
    std::vector<int> position(n);
#pragma omp for schedule(static)
    for (int I = 0; I < n; ++I) {
      for (int k = coarse.row_start[I]; k < coarse.row_start[I + 1]; ++k)
        position[coarse.column[k]] = k;
      for (int c = t.child_start[I]; c < t.child_start[I + 1]; ++c) {
        const int i = t.children[c].node;
        const double* fi = free.data() + 3 * i;
        for (int k = fine.row_start[i]; k < fine.row_start[i + 1]; ++k) {
          const int j = fine.column[k];
          const double* fj = free.data() + 3 * j;
          const double* a = A.values.data() + 9 * static_cast<std::size_t>(k);
          double block[9];
          for (int r = 0; r < 3; ++r)
            for (int s = 0; s < 3; ++s)
              block[3 * r + s] = t.children[c].weight * fi[r] * fj[s] * a[3 * r + s];
          for (int p = t.parent_start[j]; p < t.parent_start[j + 1]; ++p) {
            const double w = t.parents[p].weight;
            double* target =
                Ac->values.data() + 9 * static_cast<std::size_t>(position[t.parents[p].node]);
            for (int e = 0; e < 9; ++e) target[e] += w * block[e];
          }
        }
      }
    }
  }
}

}  // namespace calipso::fem
