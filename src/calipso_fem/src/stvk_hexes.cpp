#include "stvk_hexes.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "threads.hpp"

namespace calipso::fem {
namespace {

constexpr int kGroup = 8;         // cells that are packed together
constexpr int kSerialCells = 64;  // below: waking a second thread costs more than it saves

CornerMatrix restCorners(const VolumeMesh& mesh, int cell) {
  CornerMatrix corners(8, 3);
  for (int c = 0; c < 8; ++c) corners.row(c) = mesh.nodes.row(mesh.cells(cell, c));
  return corners;
}

// An axis-aligned box has the same diagonal Jacobian everywhere.
bool isBox(const CornerMatrix& X) {
  const Eigen::RowVector3d size = X.row(7) - X.row(0);
  const double unit = 1e-12 * size.cwiseAbs().maxCoeff();
  for (int c = 0; c < 8; ++c) {
    const Eigen::RowVector3d sides(c & 1, (c >> 1) & 1, c >> 2);
    if (((X.row(c) - X.row(0)) - size.cwiseProduct(sides)).cwiseAbs().maxCoeff() > unit)
      return false;
  }
  return true;
}

}  // namespace

StvkHexes::StvkHexes(const VolumeMesh& mesh, const std::vector<ElementKind>& kinds,
                     const std::vector<int>& kind_of)
    : mesh_(mesh),
      kinds_(kinds),
      kind_of_(kind_of),
      nodes_(mesh.nodeCount()),
      enhanced_(kinds.front().type == ElementType::kHexEnhanced) {
  std::map<const ReferenceElement*, bool> known;
  std::vector<bool> is_box(mesh.cellCount());
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const auto [it, is_new] = known.try_emplace(kinds[kind_of[cell]].reference, false);
    if (is_new) it->second = isBox(restCorners(mesh, cell));
    is_box[cell] = it->second;
  }
  numberNodes();
  orderCells(is_box);

  slot_start_.assign(nodes_ + 1, 0);
  for (int cell = 0; cell < mesh.cellCount(); ++cell)
    for (int c = 0; c < 8; ++c) ++slot_start_[cells_(cell, c) + 1];
  for (int i = 0; i < nodes_; ++i) slot_start_[i + 1] += slot_start_[i];
  first_place_.assign(nodes_, static_cast<int>(order_.size()));
  last_place_.assign(nodes_, -1);
  for (int place = 0; place < static_cast<int>(order_.size()); ++place)
    for (int c = 0; c < 8 && order_[place] >= 0; ++c) {
      const int node = cells_(order_[place], c);
      first_place_[node] = std::min(first_place_[node], place);
      last_place_[node] = std::max(last_place_[node], place);
    }
  pack(&single_);
  pack(&double_);
}

void StvkHexes::numberNodes() {
  mesh_node_.resize(nodes_);
  node_of_.resize(nodes_);
  std::iota(mesh_node_.begin(), mesh_node_.end(), 0);
  if (mesh_.lattice.rows() == nodes_) {
    const Eigen::RowVector3i low = mesh_.lattice.colwise().minCoeff();
    const Eigen::RowVector3i extent = mesh_.lattice.colwise().maxCoeff() - low;
    std::stable_sort(axes_.begin(), axes_.end(),
                     [&](int a, int b) { return extent[a] < extent[b]; });
    lattice_.resize(nodes_, 3);
    std::vector<std::array<int, 3>> place(nodes_);
    for (int i = 0; i < nodes_; ++i)
      for (int k = 0; k < 3; ++k) place[i][2 - k] = mesh_.lattice(i, axes_[k]) - low[axes_[k]];
    std::stable_sort(mesh_node_.begin(), mesh_node_.end(),
                     [&](int a, int b) { return place[a] < place[b]; });
    for (int i = 0; i < nodes_; ++i)
      for (int k = 0; k < 3; ++k) lattice_(i, k) = place[mesh_node_[i]][2 - k];
  }
  for (int i = 0; i < nodes_; ++i) node_of_[mesh_node_[i]] = i;
  cells_ = mesh_.cells.unaryExpr([this](int node) { return node_of_[node]; });
}

void StvkHexes::take(const Vec& from, int begin, int end, double* to) const {
  for (int i = begin; i < end; ++i) {
    const double* p = from.data() + 3L * mesh_node_[i];
    for (int c = 0; c < 3; ++c) to[4L * i + c] = p[c];
    to[4L * i + 3] = 0.0;
  }
}

void StvkHexes::give(const double* from, int begin, int end, Vec* to) const {
  for (int i = begin; i < end; ++i)
    for (int c = 0; c < 3; ++c) (*to)[3L * mesh_node_[i] + c] = from[4L * i + c];
}

// Boxes first; among them, groups of equal cells before those that are mixed.
void StvkHexes::orderCells(const std::vector<bool>& is_box) {
  std::vector<int> sliced(mesh_.cellCount());
  std::iota(sliced.begin(), sliced.end(), 0);
  const auto before = [this](int a, int b) { return cells_(a, 0) < cells_(b, 0); };
  std::stable_sort(sliced.begin(), sliced.end(), before);
  for (const bool box : {true, false}) {
    std::map<std::pair<int, double>, std::vector<int>> equal;
    for (const int cell : sliced)
      if (is_box[cell] == box) equal[{kind_of_[cell], mesh_.fraction[cell]}].push_back(cell);
    std::vector<int> mixed;
    for (auto& [key, cells] : equal) {
      const std::size_t grouped = cells.size() / kGroup * kGroup;
      order_.insert(order_.end(), cells.begin(), cells.begin() + grouped);
      mixed.insert(mixed.end(), cells.begin() + grouped, cells.end());
    }
    std::stable_sort(mixed.begin(), mixed.end(), before);
    order_.insert(order_.end(), mixed.begin(), mixed.end());
    while (order_.size() % kGroup != 0) order_.push_back(-1);
    if (box) boxes_ = static_cast<int>(order_.size());
  }
}

// In the order of hex_kernel.hpp; the filled fraction scales weights and mode stiffness.
std::vector<double> StvkHexes::cellConstants(int cell, bool box) const {
  const ElementKind& kind = kinds_[kind_of_[cell]];
  const ReferenceElement& ref = *kind.reference;
  const double fraction = mesh_.fraction[cell];
  std::vector<double> c = {kind.lame.lambda, 2.0 * kind.lame.mu};
  for (int q = 0; q < 8; ++q) c.push_back(fraction * ref.weight[q]);
  for (int i = 0; i < 9; ++i)
    for (int j = i; j < 9; ++j)
      c.push_back(enhanced_ ? kind.mode_stiffness_inverse(i, j) / fraction : 0.0);
  const CornerMatrix X = restCorners(mesh_, cell);
  if (box) {
    for (int k = 0; k < 3; ++k) c.push_back(1.0 / (X(7, k) - X(0, k)));
    for (int q = 0; q < 8; ++q)
      for (int k = 0; k < 3; ++k) c.push_back(ref.mode[q][3 * k](0, k));
    return c;
  }
  for (int q = 0; q < 8; ++q) {
    const Eigen::Matrix3d J = X.transpose() * hexShapeDerivative(gaussPoint(q));
    const Eigen::Matrix3d half = 0.5 * J.inverse();
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) c.push_back(half(k, j));
  }
  for (int q = 0; q < 8; ++q)
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) c.push_back(ref.mode[q][3 * k](0, j));
  return c;
}

template <class Real>
void StvkHexes::pack(Packed<Real>* p) const {
  constexpr int kLanes = kHexLanes<Real>;
  std::map<std::pair<int, double>, long> shared;  // blocks of batches of equal cells
  p->slot.resize(slot_start_.back());
  std::vector<int> next(slot_start_.begin(), slot_start_.end() - 1);
  for (int first = 0; first < static_cast<int>(order_.size()); first += kLanes) {
    const int* cells = order_.data() + first;
    const int some = *std::max_element(cells, cells + kLanes);
    bool equal = true;
    for (int l = 0; l < kLanes; ++l)
      equal = equal && cells[l] >= 0 && kind_of_[cells[l]] == kind_of_[some] &&
              mesh_.fraction[cells[l]] == mesh_.fraction[some];
    for (int c = 0; c < 8; ++c)
      for (int l = 0; l < kLanes; ++l) {
        const int node = cells_(std::max(cells[l], 0), c);
        p->node.push_back(node);
        if (cells[l] >= 0) p->slot[next[node]++] = 8 * first + c * kLanes + hexPlace<Real>(l);
      }
    const bool box = first < boxes_;
    const int numbers = box ? kBoxConstants : kHexConstants;
    const long here = static_cast<long>(p->constants.size());
    if (some < 0) {  // a batch of nothing
      p->block.push_back(here);
      p->constants.resize(here + static_cast<long>(numbers) * kLanes, Real(0));
      continue;
    }
    if (equal) {
      const auto [it, is_new] = shared.try_emplace({kind_of_[some], mesh_.fraction[some]}, here);
      p->block.push_back(it->second);
      if (!is_new) continue;
    } else {
      p->block.push_back(here);
    }
    p->constants.resize(here + static_cast<long>(numbers) * kLanes, Real(0));
    for (int l = 0; l < kLanes; ++l) {
      // A lane without a cell has no weight.
      if (cells[l] < 0) continue;
      const std::vector<double> c = cellConstants(cells[l], box);
      for (int k = 0; k < numbers; ++k)
        p->constants[here + static_cast<long>(k) * kLanes + l] = static_cast<Real>(c[k]);
    }
  }
}

void StvkHexes::recover(const HexEvaluation& e, int batch, double* slots, double* energies) const {
  constexpr int kLanes = kHexLanes<double>;
  for (int l = 0; l < kLanes; ++l) {
    const int cell = order_[kLanes * batch + l];
    if (cell < 0 || !(e.dilatations[kLanes * batch + l] < kRecoveryDilatation)) continue;
    CornerMatrix corners(8, 3);
    for (int c = 0; c < 8; ++c)
      for (int i = 0; i < 3; ++i) corners(c, i) = e.x[4L * cells_(cell, c) + i];
    ElementResult r;
    evaluateElement(kinds_[kind_of_[cell]], corners, 1, Part::kFull, &r);
    energies[kLanes * batch + l] = mesh_.fraction[cell] * r.energy;
    for (int c = 0; c < 8; ++c)
      for (int i = 0; i < 3; ++i)
        slots[4L * (8 * kLanes * batch + c * kLanes + hexPlace<double>(l)) + i] =
            mesh_.fraction[cell] * r.f[3 * c + i];
  }
}

void StvkHexes::evaluate(const Vec& x, bool stresses, bool positive, HexEvaluation* e) const {
  const std::size_t lanes = order_.size();
  e->x.resize(4 * static_cast<std::size_t>(nodes_));
  e->slots.resize(slotNumbers<double>());
  e->energies.resize(lanes);
  e->dilatations.resize(lanes);
  if (stresses) e->stress.resize(kHexStress * lanes);
  e->forces.resize(3 * nodes_);
  const HexState state{e->energies.data(), e->dilatations.data(),
                       stresses ? e->stress.data() : nullptr, positive};
  const auto work = [&](const Crew& crew) {
    const auto [first, last] = crew.share(nodes_);
    take(x, first, last, e->x.data());
    crew.barrier();
    const auto [begin, end] = crew.share(batchCount<double>());
    hexKernel().evaluate(batches<double>(), begin, end, e->x.data(), state, e->slots.data());
    for (int batch = begin; batch < end; ++batch)
      recover(*e, batch, e->slots.data(), e->energies.data());
    crew.barrier();
    for (int i = first; i < last; ++i) {
      alignas(32) double f[4];
      sumSlots(e->slots.data(), i, f);
      for (int c = 0; c < 3; ++c) e->forces[3L * mesh_node_[i] + c] = f[c];
    }
  };
  if (static_cast<int>(lanes) < kSerialCells)
    work(Crew(0, 1));
  else
    runParallel(work);
  e->energy = 0.0;
  e->dilatation = 1e300;
  for (std::size_t k = 0; k < lanes; ++k)
    if (order_[k] >= 0) {
      e->energy += e->energies[k];
      // NaN passes through to the result.
      e->dilatation = e->dilatation < e->dilatations[k] ? e->dilatation : e->dilatations[k];
    }
}

void StvkHexes::multiplyMaterial(const Vec& x, const Vec& w, HexEvaluation* e, Vec* y) const {
  e->x.resize(4 * static_cast<std::size_t>(nodes_));
  e->slots.resize(slotNumbers<double>());
  AlignedBuffer<double> u(e->x.size());
  y->resize(w.size());
  runParallel([&](const Crew& crew) {
    const auto [first, last] = crew.share(nodes_);
    take(x, first, last, e->x.data());
    take(w, first, last, u.data());
    crew.barrier();
    const auto [begin, end] = crew.share(batchCount<double>());
    hexKernel().multiply(batches<double>(), begin, end, e->x.data(), nullptr, 1.0, u.data(),
                         e->slots.data());
    crew.barrier();
    for (int i = first; i < last; ++i) {
      alignas(32) double f[4];
      sumSlots(e->slots.data(), i, f);
      for (int c = 0; c < 3; ++c) (*y)[3L * mesh_node_[i] + c] = f[c];
    }
  });
}

}  // namespace calipso::fem
