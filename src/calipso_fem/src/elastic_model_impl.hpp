#pragma once

#include <array>

#include "calipso_fem/elastic_model.hpp"
#include "cell_coloring.hpp"
#include "element.hpp"
#include "stvk_batch.hpp"
#include "stvk_hexes.hpp"

namespace calipso::fem {

// Below this, waking a second thread for every colour costs more than it saves.
inline constexpr int kSerialCells = 64;

// Corners of one cell (corners x 3) out of a 3n vector.
inline CornerMatrix cornersOf(const CellMatrix& cells, int cell, const double* x) {
  CornerMatrix corners(cells.cols(), 3);
  for (int c = 0; c < cells.cols(); ++c) {
    const double* p = x + 3 * cells(cell, c);
    corners.row(c) << p[0], p[1], p[2];
  }
  return corners;
}

struct ElasticModel::Impl {
  VolumeMesh mesh;
  MaterialModel model;
  ElementType type;
  std::vector<Material> materials;  // per cell
  std::vector<std::unique_ptr<ReferenceElement>> references;
  std::vector<int> reference_of;  // per cell
  std::vector<ElementKind> kinds;
  std::vector<int> kind_of;  // per cell
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<int> block_of;  // per cell, corners x corners
  CellColoring coloring;
  // Cells of one colour and kind, four by four, where the batch kernel can take them.
  struct Batch {
    std::array<int, kLanes> cell;  // the last one repeats where fewer are left
    int count;
  };
  std::vector<StvkBatchKind> batch_kinds;  // as kinds
  std::vector<Batch> batches;
  std::vector<int> batch_start;      // by colour
  std::unique_ptr<StvkHexes> hexes;  // beside the batches
  Eigen::VectorXd lumped_mass;

  void buildReferences();
  void buildKinds();
  void buildBlocks();
  void buildMass();
  void buildBatches();
  bool isBatched() const { return !batches.empty(); }
  // Calls work(cell, lane, result) for all cells of batched models.
  template <class Work>
  void forEachBatched(const Vec& x, int derivatives, StvkPart part, const Work& work) const;
  ElementResult evaluate(int cell, const Vec& x, int derivatives, Part part) const;
  void addToMatrix(int cell, const ElementResult& r, BlockMatrix& K) const;
  void addToMatrix(int cell, int lane, const StvkBatchResult& r, BlockMatrix& K) const;
  template <class Work>
  void forEachCell(const Work& work) const;
  void assemble(const Vec& x, Part part, BlockMatrix& K) const;
};

// Calls work(cell) colour by colour: cells of one colour share no node, so that sums into nodes are
// free of races and always in the same order.
template <class Work>
void ElasticModel::Impl::forEachCell(const Work& work) const {
  for (std::size_t color = 0; color + 1 < coloring.start.size(); ++color) {
    const int start = coloring.start[color];
    parallelFor(coloring.start[color + 1] - start, kSerialCells, [&](int begin, int end) {
      for (int k = start + begin; k < start + end; ++k) work(coloring.cells[k]);
    });
  }
}

template <class Work>
void ElasticModel::Impl::forEachBatched(const Vec& x, int derivatives, StvkPart part,
                                        const Work& work) const {
  for (std::size_t color = 0; color + 1 < batch_start.size(); ++color) {
    const auto evaluateBatch = [&](int k) {
      const Batch& batch = batches[k];
      alignas(32) double corners[24][kLanes];
      StvkBatchResult result;
      for (int l = 0; l < kLanes; ++l)
        for (int c = 0; c < 8; ++c)
          for (int i = 0; i < 3; ++i)
            corners[3 * c + i][l] = x[3 * mesh.cells(batch.cell[l], c) + i];
      evaluateStvkBatch(batch_kinds[kind_of[batch.cell[0]]], corners, derivatives, part, &result);
      for (int l = 0; l < batch.count; ++l) work(batch.cell[l], l, result);
    };
    const int start = batch_start[color];
    parallelFor(batch_start[color + 1] - start, kSerialCells / kLanes, [&](int begin, int end) {
      for (int k = start + begin; k < start + end; ++k) evaluateBatch(k);
    });
  }
}

}  // namespace calipso::fem
