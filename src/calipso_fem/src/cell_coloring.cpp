#include "cell_coloring.hpp"

#include <algorithm>
#include <cstdint>

namespace calipso::fem {
namespace {

// Lowest colour that no corner of the cell has seen. 128 colours suffice: a corner of the Kuhn
// split has 24 cells.
int freeColor(const CellMatrix& cells, int cell, const std::vector<std::vector<bool>>& used) {
  for (int color = 0;; ++color) {
    bool taken = false;
    for (int c = 0; c < cells.cols() && !taken; ++c) {
      const auto& seen = used[cells(cell, c)];
      taken = color < static_cast<int>(seen.size()) && seen[color];
    }
    if (!taken) return color;
  }
}

}  // namespace

CellColoring colorCells(const CellMatrix& cells, int nodes) {
  std::vector<std::vector<bool>> used(nodes);
  std::vector<int> color_of(cells.rows());
  int colors = 0;
  for (int cell = 0; cell < cells.rows(); ++cell) {
    const int color = freeColor(cells, cell, used);
    color_of[cell] = color;
    colors = std::max(colors, color + 1);
    for (int c = 0; c < cells.cols(); ++c) {
      auto& seen = used[cells(cell, c)];
      if (static_cast<int>(seen.size()) <= color) seen.resize(color + 1, false);
      seen[color] = true;
    }
  }
  CellColoring coloring;
  coloring.start.assign(colors + 1, 0);
  for (int color : color_of) ++coloring.start[color + 1];
  for (int c = 0; c < colors; ++c) coloring.start[c + 1] += coloring.start[c];
  coloring.cells.resize(cells.rows());
  std::vector<int> next(coloring.start.begin(), coloring.start.end() - 1);
  for (int cell = 0; cell < cells.rows(); ++cell) coloring.cells[next[color_of[cell]]++] = cell;
  return coloring;
}

}  // namespace calipso::fem
