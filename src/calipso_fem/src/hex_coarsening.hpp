#pragma once

#include <vector>

#include "calipso_fem/block_matrix.hpp"
#include "grid_transfer.hpp"
#include "stvk_hexes.hpp"

namespace calipso::fem {

// Which coarse cell of the next level each fine cell lies in.
struct HexCoarsening {
  CellMatrix coarse_cells;            // #coarse cells x 8
  std::vector<int> coarse_of;         // per place in StvkHexes::order(); -1: no cell
  std::vector<unsigned char> parity;  // bits: odd along x, y, z
  std::vector<int> block_of;          // per coarse cell, 8 x 8, in the coarse pattern
  std::vector<int> parent_blocks;     // per fine node, each pair of its parents, likewise
};

// coarse_cells, coarse_of and parity.
HexCoarsening coarseCells(const StvkHexes& hexes, const GridTransfer& transfer);

// block_of and parent_blocks.
void placeBlocks(const BlockPattern& coarse, const GridTransfer& transfer, HexCoarsening* c);

}  // namespace calipso::fem
