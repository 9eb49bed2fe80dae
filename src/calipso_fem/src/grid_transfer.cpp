#include "grid_transfer.hpp"

#include <algorithm>

#include "thread_team.hpp"

namespace calipso::fem {
namespace {

// Calls visit(x, y, z, weight) for the coarse lattice positions around a fine one.
template <class Visit>
void forEachParent(const Eigen::RowVector3i& p, const Visit& visit) {
  const Eigen::RowVector3i low = p / 2, odd(p.x() & 1, p.y() & 1, p.z() & 1);
  const double weight = 1.0 / (1 << odd.sum());
  for (int k = 0; k <= odd.z(); ++k)
    for (int j = 0; j <= odd.y(); ++j)
      for (int i = 0; i <= odd.x(); ++i) visit(low.x() + i, low.y() + j, low.z() + k, weight);
}

}  // namespace

LatticeIndex::LatticeIndex(const Eigen::RowVector3i& size)
    : size_(size), id_(static_cast<std::size_t>(size.x()) * size.y() * size.z(), -1) {}

GridTransfer makeGridTransfer(const LatticeMatrix& fine_lattice) {
  const int n = static_cast<int>(fine_lattice.rows());
  LatticeIndex id((fine_lattice.colwise().maxCoeff().array() + 1) / 2 + 1);
  for (int i = 0; i < n; ++i)
    forEachParent(fine_lattice.row(i), [&](int x, int y, int z, double) { id.at(x, y, z) = 0; });
  GridTransfer t;
  int next = 0;
  for (int& node : id.all())
    if (node == 0) node = next++;
  t.coarse_lattice.resize(next, 3);
  for (int z = 0; z < id.size().z(); ++z)
    for (int y = 0; y < id.size().y(); ++y)
      for (int x = 0; x < id.size().x(); ++x)
        if (id.at(x, y, z) >= 0) t.coarse_lattice.row(id.at(x, y, z)) << x, y, z;

  t.parent_start.assign(1, 0);
  t.child_start.assign(next + 1, 0);
  for (int i = 0; i < n; ++i) {
    forEachParent(fine_lattice.row(i), [&](int x, int y, int z, double weight) {
      t.parents.push_back({id.at(x, y, z), static_cast<float>(weight)});
      ++t.child_start[id.at(x, y, z) + 1];
    });
    t.parent_start.push_back(static_cast<int>(t.parents.size()));
  }
  for (int I = 0; I < next; ++I) t.child_start[I + 1] += t.child_start[I];
  t.children.resize(t.parents.size());
  std::vector<int> place(t.child_start.begin(), t.child_start.end() - 1);
  for (int i = 0; i < n; ++i)
    for (int k = t.parent_start[i]; k < t.parent_start[i + 1]; ++k)
      t.children[place[t.parents[k].node]++] = {i, t.parents[k].weight};
  return t;
}

std::shared_ptr<const BlockPattern> coarsePattern(const BlockPattern& fine, const GridTransfer& t) {
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
  parallelFor(n, 64, [&](int begin, int end) {
    std::vector<int> position(n);
    for (int I = begin; I < end; ++I) {
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
  });
}

}  // namespace calipso::fem
