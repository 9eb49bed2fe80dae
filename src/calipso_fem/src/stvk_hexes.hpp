#pragma once

#include <array>
#include <memory>
#include <vector>

#include "aligned_buffer.hpp"
#include "element.hpp"
#include "grid_transfer.hpp"
#include "hex_kernel.hpp"
#include "thread_team.hpp"

namespace calipso::fem {

// What one evaluation of the elastic energy at x has found.
struct HexEvaluation {
  AlignedBuffer<double> x;  // four per node
  // geometric stresses, as the kernel stores them; empty unless asked for
  AlignedBuffer<double> stress;
  AlignedBuffer<double> slots, energies, dilatations;  // work space
  Vec forces;                                          // 3n, N
  double energy = 0.0;                                 // J
  double dilatation = 0.0;                             // least det F
};

// The cells of a mesh of St. Venant-Kirchhoff hexahedra (Q1 or enhanced), packed for
// hex_kernel.hpp: eight cells a batch in single, four in double precision, in the same order. Nodes
// and cells are numbered anew, slice by slice across the longest side of the lattice: what
// neighbouring slices share stays in the cache, and threads share the smallest of them. Immutable.
class StvkHexes {
 public:
  // cell -> its kind; the kinds' references must outlive this.
  StvkHexes(const VolumeMesh& mesh, const std::vector<ElementKind>& kinds,
            const std::vector<int>& kind_of);

  int nodeCount() const { return nodes_; }
  // The mesh's number of a node, and back.
  int meshNode(int node) const { return mesh_node_[node]; }
  int nodeOf(int mesh_node) const { return node_of_[mesh_node]; }
  // Corners of the mesh's cells, in the new numbering.
  const CellMatrix& cells() const { return cells_; }
  // Lattice of the nodes; its column k runs along the mesh's axis axes()[k]. Empty where the mesh
  // has none.
  const LatticeMatrix& lattice() const { return lattice_; }
  const std::array<int, 3>& axes() const { return axes_; }

  // 3 numbers per node of the mesh <-> 4 per node, begin .. end of the new numbering.
  void take(const Vec& from, int begin, int end, double* to) const;
  void give(const double* from, int begin, int end, Vec* to) const;

  // Cells of the batches; -1 marks a lane without one. A multiple of 8.
  const std::vector<int>& order() const { return order_; }
  template <class Real>
  int batchCount() const {
    return static_cast<int>(order_.size()) / kHexLanes<Real>;
  }
  template <class Real>
  HexBatches<Real> batches() const;
  template <class Real>
  std::size_t slotNumbers() const {
    return 32 * order_.size();
  }

  // First and last place in order() of a node's cells.
  int firstPlace(int node) const { return first_place_[node]; }
  int lastPlace(int node) const { return last_place_[node]; }

  // Sum of a node's slots: y[0..3].
  template <class Real>
  void sumSlots(const Real* slots, int node, Real* y) const;

  // Energy, forces and least dilatation at x; stresses where asked for, with `positive` shifted to
  // positive ones. Cells below kRecoveryDilatation get their recovery energy and force.
  void evaluate(const Vec& x, bool stresses, bool positive, HexEvaluation* result) const;
  // y = material part of the tangent at x times w.
  void multiplyMaterial(const Vec& x, const Vec& w, HexEvaluation* scratch, Vec* y) const;

 private:
  template <class Real>
  struct Packed {
    std::vector<int> node;
    AlignedBuffer<Real> constants;
    std::vector<long> block;
    std::vector<int> slot;  // per node, in the order of slot_start_
  };

  void numberNodes();
  void orderCells(const std::vector<bool>& is_box);
  template <class Real>
  void pack(Packed<Real>* packed) const;
  std::vector<double> cellConstants(int cell, bool box) const;
  void recover(const HexEvaluation& e, int batch, double* slots, double* energies) const;
  template <class Real>
  const Packed<Real>& packed() const;

  const VolumeMesh& mesh_;
  const std::vector<ElementKind>& kinds_;
  const std::vector<int>& kind_of_;
  int nodes_ = 0;
  std::array<int, 3> axes_{0, 1, 2};
  std::vector<int> mesh_node_, node_of_;
  LatticeMatrix lattice_;
  CellMatrix cells_;
  int boxes_ = 0;  // cells of order_ that stand in batches of boxes
  bool enhanced_ = false;
  std::vector<int> order_;
  std::vector<int> first_place_, last_place_;
  std::vector<int> slot_start_;
  Packed<float> single_;
  Packed<double> double_;
};

template <>
inline const StvkHexes::Packed<float>& StvkHexes::packed<float>() const {
  return single_;
}
template <>
inline const StvkHexes::Packed<double>& StvkHexes::packed<double>() const {
  return double_;
}

template <class Real>
HexBatches<Real> StvkHexes::batches() const {
  const Packed<Real>& p = packed<Real>();
  return {p.node.data(), p.constants.data(), p.block.data(), boxes_ / kHexLanes<Real>, enhanced_};
}

template <class Real>
inline void StvkHexes::sumSlots(const Real* slots, int node, Real* y) const {
  // Sixteen bytes at a time: what every target has.
  typedef Real Part __attribute__((vector_size(16)));
  constexpr int kParts = static_cast<int>(sizeof(Real)) / 4;
  const int* slot = packed<Real>().slot.data();
  Part sum[kParts] = {};
  for (int k = slot_start_[node]; k < slot_start_[node + 1]; ++k)
    for (int p = 0; p < kParts; ++p)
      sum[p] += reinterpret_cast<const Part*>(slots + 4L * slot[k])[p];
  for (int p = 0; p < kParts; ++p) reinterpret_cast<Part*>(y)[p] = sum[p];
}

}  // namespace calipso::fem
