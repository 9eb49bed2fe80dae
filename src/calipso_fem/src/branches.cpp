#include "branches.hpp"

#include <algorithm>
#include <array>
#include <calipso_scene/disjoint_sets.hpp>
#include <map>
#include <numeric>
#include <unordered_map>

namespace calipso::fem {
namespace {

using Eigen::Vector3i;

constexpr int kMostBranches = 8;

// The parts of the solid within one cell.
struct Parts {
  std::vector<int> label;  // s^3, x fastest: -1 empty, else the part
  std::vector<int> size;   // sub-voxels of each part
};

// All of the cell's solid as one part.
Parts onePart(const CoveredCell& cell, const Occupancy& occupancy, int s) {
  Parts parts;
  parts.label.resize(s * s * s);
  const Vector3i low = cell.position * s;
  int count = 0;
  for (int k = 0, at = 0; k < s; ++k)
    for (int j = 0; j < s; ++j)
      for (int i = 0; i < s; ++i, ++at) {
        const bool inside = occupancy.get(low.x() + i, low.y() + j, low.z() + k);
        parts.label[at] = inside ? 0 : -1;
        count += inside;
      }
  if (count > 0) parts.size.push_back(count);
  return parts;
}

// Its connected parts, in the order of their first sub-voxels.
Parts connectedParts(const CoveredCell& cell, const Occupancy& occupancy, int s) {
  Parts parts = onePart(cell, occupancy, s);
  if (parts.size.empty() || parts.size[0] == s * s * s) return parts;
  constexpr int kUnseen = -2;
  for (int& l : parts.label)
    if (l == 0) l = kUnseen;
  parts.size.clear();
  std::vector<Vector3i> stack;
  for (int seed = 0; seed < s * s * s; ++seed) {
    if (parts.label[seed] != kUnseen) continue;
    const int label = static_cast<int>(parts.size.size());
    parts.size.push_back(0);
    parts.label[seed] = label;
    stack.assign(1, Vector3i(seed % s, seed / s % s, seed / (s * s)));
    while (!stack.empty()) {
      const Vector3i p = stack.back();
      stack.pop_back();
      ++parts.size[label];
      // Over edges and corners too: a sheet thinner than a sub-voxel is sampled as a staircase.
      for (int around = 0; around < 27; ++around) {
        const Vector3i n = p + Vector3i(around % 3 - 1, around / 3 % 3 - 1, around / 9 - 1);
        if (n.minCoeff() < 0 || n.maxCoeff() >= s) continue;
        int& l = parts.label[n.x() + s * (n.y() + s * n.z())];
        if (l != kUnseen) continue;
        l = label;
        stack.push_back(n);
      }
    }
  }
  return parts;
}

// The largest part comes first; specks below 2 % of the cell, and parts beyond the most, are
// counted to it.
void mergeSpecks(Parts* parts, int s) {
  const int n = static_cast<int>(parts->size.size());
  if (n < 2) return;
  std::vector<int> order(n), renamed(n, 0);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return parts->size[a] > parts->size[b]; });
  std::vector<int> size;
  for (int rank = 0; rank < n; ++rank) {
    const int part = order[rank];
    const bool keep = rank == 0 || (parts->size[part] * 50 > s * s * s && rank < kMostBranches);
    renamed[part] = keep ? static_cast<int>(size.size()) : 0;
    if (keep)
      size.push_back(parts->size[part]);
    else
      size[0] += parts->size[part];
  }
  parts->size = size;
  for (int& l : parts->label)
    if (l >= 0) l = renamed[l];
}

// For every part of `a`: the set of parts of `b` behind the face that it touches, over edges and
// corners of the sub-voxels too.
std::array<unsigned, kMostBranches> contacts(const Parts& a, const Parts& b, int face, int s) {
  std::array<unsigned, kMostBranches> touched{};
  const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
  for (int i = 0; i < s; ++i)
    for (int j = 0; j < s; ++j) {
      Vector3i p, q;
      p[u] = i;
      p[v] = j;
      p[axis] = face % 2 ? s - 1 : 0;
      q[axis] = face % 2 ? 0 : s - 1;
      const int la = a.label[p.x() + s * (p.y() + s * p.z())];
      if (la < 0) continue;
      for (q[u] = std::max(0, i - 1); q[u] <= std::min(s - 1, i + 1); ++q[u])
        for (q[v] = std::max(0, j - 1); q[v] <= std::min(s - 1, j + 1); ++q[v]) {
          const int lb = b.label[q.x() + s * (q.y() + s * q.z())];
          if (lb >= 0) touched[la] |= 1u << lb;
        }
    }
  return touched;
}

// Octants that hold next to nothing keep this share, so that no Gauss point goes without stiffness.
constexpr double kLeastShare = 0.03;

void spreadOverOctants(const Parts& parts, int part, int s, CoveredCell* cell) {
  if (parts.size.size() == 1 && parts.size[0] == s * s * s) return;  // even, as it is
  double count[8] = {}, total = 0.0;
  // The middle sub-voxels of an odd count belong to both halves.
  const auto half = [s](int i, int side) {
    return 2 * i + 1 == s ? 0.5 : (2 * i + 1 > s) == (side == 1) ? 1.0 : 0.0;
  };
  for (int k = 0; k < s; ++k)
    for (int j = 0; j < s; ++j)
      for (int i = 0; i < s; ++i)
        for (int o = 0; parts.label[i + s * (j + s * k)] == part && o < 8; ++o)
          count[o] += half(i, o & 1) * half(j, o >> 1 & 1) * half(k, o >> 2);
  for (double c : count) total += c;
  if (total == 0.0) return;
  double sum = 0.0;
  for (int o = 0; o < 8; ++o) sum += cell->share[o] = std::max(kLeastShare, 8.0 * count[o] / total);
  for (double& share : cell->share) share *= 8.0 / sum;
}

using CellMap = std::map<std::array<int, 3>, int>;

int neighbourOf(const CellMap& index, Vector3i p, int face) {
  p[face / 2] += face % 2 ? 1 : -1;
  const auto it = index.find({p.x(), p.y(), p.z()});
  return it == index.end() ? -1 : it->second;
}

// A few cells that touch no others are a product of coarse sampling, or of a model whose small
// parts do not reach each other: they are welded to all around them.
void weldCrumbs(std::vector<CoveredCell>* cells) {
  constexpr double kCrumb = 0.02;  // of all cells
  const int n = static_cast<int>(cells->size());
  DisjointSets parts(n);
  for (const FaceContact& contact : faceContacts(*cells)) parts.join(contact.low, contact.high);
  std::vector<int> size(n, 0);
  for (int c = 0; c < n; ++c) ++size[parts.find(c)];
  for (int c = 0; c < n; ++c)
    if (size[parts.find(c)] <= std::max(1.0, kCrumb * n))
      std::fill((*cells)[c].neighbours, (*cells)[c].neighbours + 6, ~0u);
}

}  // namespace

std::vector<CoveredCell> separateBranches(const std::vector<CoveredCell>& cells,
                                          const Occupancy& occupancy, int s, bool separate) {
  CellMap index;
  std::vector<Parts> parts(cells.size());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const Vector3i& p = cells[c].position;
    if (separate) index[{p.x(), p.y(), p.z()}] = static_cast<int>(c);
    parts[c] = separate ? connectedParts(cells[c], occupancy, s) : onePart(cells[c], occupancy, s);
    mergeSpecks(&parts[c], s);
  }
  std::vector<CoveredCell> result;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const int n = std::max<int>(1, static_cast<int>(parts[c].size.size()));
    const double total = std::accumulate(parts[c].size.begin(), parts[c].size.end(), 0.0);
    std::vector<CoveredCell> pieces(n, cells[c]);
    for (int b = 0; b < n; ++b) {
      pieces[b].branch = b;
      if (n > 1) pieces[b].fraction *= parts[c].size[b] / total;
      spreadOverOctants(parts[c], b, s, &pieces[b]);
    }
    for (int face = 0; separate && face < 6; ++face) {
      const int other = neighbourOf(index, cells[c].position, face);
      if (other < 0 || (n == 1 && parts[other].size.size() <= 1)) continue;
      const auto touched = contacts(parts[c], parts[other], face, s);
      for (int b = 0; b < n; ++b) pieces[b].neighbours[face] = touched[b];
    }
    result.insert(result.end(), pieces.begin(), pieces.end());
  }
  if (separate) weldCrumbs(&result);
  return result;
}

}  // namespace calipso::fem
