#include "hex_coarsening.hpp"

#include <array>

namespace calipso::fem {

HexCoarsening coarseCells(const StvkHexes& hexes, const GridTransfer& t) {
  const LatticeMatrix& coarse = t.coarse_lattice;
  const std::array<int, 3>& axes = hexes.axes();
  const Eigen::RowVector3i size = coarse.colwise().maxCoeff().array() + 1;
  LatticeIndex node(size), cell_id(size);
  for (int i = 0; i < coarse.rows(); ++i) node.at(coarse(i, 0), coarse(i, 1), coarse(i, 2)) = i;
  HexCoarsening c;
  std::vector<Eigen::RowVector3i> corners;
  for (int cell : hexes.order()) {
    if (cell < 0) {
      c.coarse_of.push_back(-1);
      c.parity.push_back(0);
      continue;
    }
    const Eigen::RowVector3i at = hexes.lattice().row(hexes.cells()(cell, 0)), parent = at / 2;
    int& id = cell_id.at(parent.x(), parent.y(), parent.z());
    if (id < 0) {
      id = static_cast<int>(corners.size());
      corners.push_back(parent);
    }
    c.coarse_of.push_back(id);
    c.parity.push_back((at.x() & 1) << axes[0] | (at.y() & 1) << axes[1] | (at.z() & 1) << axes[2]);
  }
  c.coarse_cells.resize(corners.size(), 8);
  for (std::size_t k = 0; k < corners.size(); ++k)
    for (int b = 0; b < 8; ++b)
      c.coarse_cells(k, b) =
          node.at(corners[k].x() + (b >> axes[0] & 1), corners[k].y() + (b >> axes[1] & 1),
                  corners[k].z() + (b >> axes[2] & 1));
  return c;
}

void placeBlocks(const BlockPattern& coarse, const GridTransfer& t, HexCoarsening* c) {
  for (int i = 0; i < t.fineCount(); ++i)
    for (int p = t.parent_start[i]; p < t.parent_start[i + 1]; ++p)
      for (int q = t.parent_start[i]; q < t.parent_start[i + 1]; ++q)
        c->parent_blocks.push_back(coarse.find(t.parents[p].node, t.parents[q].node));
  for (int k = 0; k < c->coarse_cells.rows(); ++k)
    for (int a = 0; a < 8; ++a)
      for (int b = 0; b < 8; ++b)
        c->block_of.push_back(coarse.find(c->coarse_cells(k, a), c->coarse_cells(k, b)));
}

}  // namespace calipso::fem
