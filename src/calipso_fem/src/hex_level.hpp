#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "quad.hpp"
#include "stvk_hexes.hpp"

namespace calipso::fem {

// A spring's share of the system: block times w w^T for the nodes it hangs on.
struct SpringBlock {
  std::vector<std::pair<int, double>> weights;
  Eigen::Matrix3d block;
};

// A = K_material(x) + viscosity K_material(viscous_at) + K_geometric(x) + inertia M + springs, rows
// and columns of fixed components out. The float level takes all of it at x.
struct HexSystem {
  bool positive = false;   // known to be positive definite
  double viscosity = 0.0;  // rate * stiffness damping
  Vec viscous_at;          // 3n, m, where the viscosity acts; empty: at the positions themselves
  double inertia = 0.0;    // 1/s^2, times the lumped mass
  std::vector<SpringBlock> springs;
};

// What springs add to a product: kept per node, four numbers each, zero where no spring hangs.
template <class Real>
class SpringForces {
 public:
  void allocate(std::size_t nodes) { force_.assign(4 * nodes, Real(0)); }

  void set(const std::vector<SpringBlock>& springs) {
    clear();
    springs_ = springs;
  }

  void apply(const Real* u) {
    clear();
    for (const SpringBlock& s : springs_) {
      Vector p = Vector::Zero();
      for (const auto& [node, weight] : s.weights)
        p += static_cast<Real>(weight) * Eigen::Map<const Vector>(u + 4L * node);
      const Vector force = s.block.cast<Real>() * p;
      for (const auto& [node, weight] : s.weights)
        Eigen::Map<Vector>(&force_[4L * node]) += static_cast<Real>(weight) * force;
    }
  }

  bool empty() const { return springs_.empty(); }
  const Real* at(int node) const { return &force_[4L * node]; }

 private:
  using Vector = Eigen::Matrix<Real, 3, 1>;
  void clear() {
    for (const SpringBlock& s : springs_)
      for (const auto& [node, weight] : s.weights) Eigen::Map<Vector>(&force_[4L * node]).setZero();
  }

  std::vector<SpringBlock> springs_;
  AlignedBuffer<Real> force_;
};

// A product without a matrix: multiply(first, last) fills the slots of some batches, row(node) sums
// up nodes begin .. end of this thread. `early`: a row is made as soon as its cells are done, while
// they are in the cache.
template <class Real, class Multiply, class Row>
void sweepRows(const Crew& crew, const StvkHexes& hexes, int begin, int end, bool early,
               const Multiply& multiply, const Row& row) {
  constexpr int kLanes = kHexLanes<Real>, kBatches = 512 / kLanes;
  const auto [first, last] = crew.share(hexes.batchCount<Real>());
  int from = begin;
  while (from < end && hexes.firstPlace(from) < kLanes * first) ++from;
  int next = from;
  for (int batch = first; batch < last; batch += kBatches) {
    const int stop = std::min(batch + kBatches, last);
    multiply(batch, stop);
    for (; early && next < end && hexes.firstPlace(next) >= kLanes * first &&
           hexes.lastPlace(next) < kLanes * stop;
         ++next)
      row(next);
  }
  crew.barrier();
  for (int i = begin; i < from; ++i) row(i);
  for (int i = next; i < end; ++i) row(i);
}

// The finest level of the multigrid, in single precision: the system's operator without its matrix.
// Used inside parallel regions.
class HexLevel {
 public:
  // Calls work(node, row of A u) for nodes begin .. end of this thread; u is complete.
  template <class Work>
  void product(const Crew& crew, const float* u, int begin, int end, const Work& work) {
    if (crew.rank() == 0 && !springs_.empty()) springs_.apply(u);
    const auto multiply = [&](int first, int last) {
      hexKernel().multiplyFloat(hexes->batches<float>(), first, last, x.data(), stress.data(),
                                factor, u, slots.data());
    };
    sweepRows<float>(crew, *hexes, begin, end, springs_.empty(), multiply,
                     [&](int node) { work(node, row(node, u)); });
  }

  void allocate(const StvkHexes& hexes);
  // Positions and stresses as in HexEvaluation; mass: inertia times mass; fixed: dofs of the mesh
  // taken out.
  void load(const AlignedBuffer<double>& at, const AlignedBuffer<double>& at_stress,
            const HexSystem& system, const AlignedBuffer<double>& mass,
            const std::vector<int>& fixed);

  const StvkHexes* hexes = nullptr;
  AlignedBuffer<float> x, stress, free, mass, slots;
  float factor = 1.0f;

 private:
  // @pre the cells of the node are done
  Quad row(int node, const float* u) const {
    alignas(16) float sum[4];
    hexes->sumSlots(slots.data(), node, sum);
    const std::size_t at = 4 * static_cast<std::size_t>(node);
    Quad y = loadQuad(sum) + splat(mass[node]) * loadQuad(u + at);
    if (!springs_.empty()) y += loadQuad(springs_.at(node));
    return y * loadQuad(free.data() + at);
  }

  SpringForces<float> springs_;
};

}  // namespace calipso::fem
