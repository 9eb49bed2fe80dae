#pragma once

#include <vector>

#include "calipso_fem/volume_mesh.hpp"

namespace calipso::fem {

// Groups of cells in which no two share a node: cells[start[c] .. start[c + 1]) have colour c.
struct CellColoring {
  std::vector<int> start;
  std::vector<int> cells;
};

// Greedy, in the order of the cells.
CellColoring colorCells(const CellMatrix& cells, int nodes);

}  // namespace calipso::fem
