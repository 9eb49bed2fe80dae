#include "voxel_cells.hpp"

#include <algorithm>
#include <cmath>

#include "branches.hpp"
#include "column_scan.hpp"
#include "triangle_box.hpp"

namespace calipso::fem {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// What the sight lines along one axis say about every cell.
struct AxisCover {
  std::vector<double> length;  // inside the solid, over all balanced lines, in cell sizes
  std::vector<int> lines;      // balanced lines through the cell
  std::vector<int> crossings;  // of balanced lines, within the cell
};

struct Coverage {
  AxisCover axis[3];
  Occupancy occupancy;  // sub-voxels, from the lines along z
  long open_lines = 0, lines = 0;
};

// Cells [from, to] along the axis in lattice units get their share of one inside interval.
void addInterval(const VoxelLayout& layout, int axis, Vector3i cell, double from, double to,
                 AxisCover* cover) {
  const int last = layout.count[axis] - 1;
  const int first = std::clamp(static_cast<int>(std::floor(from)), 0, last);
  for (int k = first; k <= last && k < to; ++k) {
    cell[axis] = k;
    const double share = std::min(to, k + 1.0) - std::max(from, double(k));
    cover->length[layout.index(cell.x(), cell.y(), cell.z())] += std::max(0.0, share);
  }
}

void markOccupied(int s, const Vector3i& line, double from, double to, Occupancy* occupancy) {
  const int first = std::max(0, static_cast<int>(std::ceil(from * s - 0.5)));
  for (int k = first; k + 0.5 < to * s && k < occupancy->size.z(); ++k)
    occupancy->set(line.x(), line.y(), k);
}

void scanAxis(const TriangleMesh& surface, const VoxelLayout& layout, int s, int axis,
              int orientation, Coverage* coverage) {
  ColumnLayout lines;
  lines.axis = axis;
  lines.origin = layout.origin;
  lines.spacing = layout.cell_size / s;
  lines.u_count = layout.count[lines.u()] * s;
  lines.v_count = layout.count[lines.v()] * s;
  AxisCover& cover = coverage->axis[axis];
  const std::size_t cells = layout.count.cast<std::size_t>().prod();
  cover.length.assign(cells, 0.0);
  cover.lines.assign(cells, 0);
  cover.crossings.assign(cells, 0);
  const auto columns = scanColumns(surface, lines, orientation);
  for (int j = 0; j < lines.v_count; ++j)
    for (int i = 0; i < lines.u_count; ++i) {
      const auto& column = columns[i + static_cast<std::size_t>(lines.u_count) * j];
      ++coverage->lines;
      if (!isBalanced(column)) {
        ++coverage->open_lines;
        continue;
      }
      Vector3i cell, line;
      cell[lines.u()] = i / s;
      cell[lines.v()] = j / s;
      line[lines.u()] = i;
      line[lines.v()] = j;
      const auto toLattice = [&](double x) { return (x - layout.origin[axis]) / layout.cell_size; };
      for (cell[axis] = 0; cell[axis] < layout.count[axis]; ++cell[axis])
        ++cover.lines[layout.index(cell.x(), cell.y(), cell.z())];
      for (const Crossing& c : column) {
        cell[axis] = std::clamp(static_cast<int>(toLattice(c.depth)), 0, layout.count[axis] - 1);
        ++cover.crossings[layout.index(cell.x(), cell.y(), cell.z())];
      }
      forEachInterval(column, [&](double from, double to) {
        addInterval(layout, axis, cell, toLattice(from), toLattice(to), &cover);
        if (axis == 2) markOccupied(s, line, toLattice(from), toLattice(to), &coverage->occupancy);
      });
    }
}

// Filled fraction of a cell, negative where no line is closed. A line measures a surface best that
// it crosses head-on, and crosses it the more often: hence the squared counts as weights.
double cellFraction(const Coverage& coverage, int cell) {
  double sum = 0.0, weight = 0.0;
  for (const AxisCover& cover : coverage.axis) {
    if (cover.lines[cell] == 0) continue;
    const double w = 1e-6 + static_cast<double>(cover.crossings[cell]) * cover.crossings[cell];
    sum += w * cover.length[cell] / cover.lines[cell];
    weight += w;
  }
  return weight > 0.0 ? sum / weight : -1.0;
}

std::vector<bool> touchedCells(const TriangleMesh& surface, const VoxelLayout& layout,
                               double margin) {
  std::vector<bool> touched(layout.count.cast<std::size_t>().prod(), false);
  for (int face = 0; face < surface.triangleCount(); ++face) {
    Eigen::Matrix3d corners;
    for (int c = 0; c < 3; ++c)
      corners.col(c) =
          (surface.vertex(surface.triangles(face, c)) - layout.origin) / layout.cell_size;
    const Vector3i low = corners.rowwise().minCoeff().array().floor().cast<int>().max(0);
    const Vector3i high =
        corners.rowwise().maxCoeff().array().floor().cast<int>().min(layout.count.array() - 1);
    for (int k = low.z(); k <= high.z(); ++k)
      for (int j = low.y(); j <= high.y(); ++j)
        for (int i = low.x(); i <= high.x(); ++i)
          if (triangleMeetsUnitCube(corners, Vector3d(i, j, k), margin))
            touched[layout.index(i, j, k)] = true;
  }
  return touched;
}

void report(const Coverage& coverage, double filled, std::size_t cells,
            std::vector<std::string>* messages) {
  if (coverage.open_lines > 0)
    messages->push_back(
        "the surface is not closed (" +
        std::to_string(100.0 * coverage.open_lines / coverage.lines) +
        " % of the sight lines do not leave it as often as they enter); cells there "
        "follow the other lines, or the surface alone. Close the mesh for exact volumes");
  if (filled < 0.02 * cells)
    messages->push_back("the surface encloses only " + std::to_string(100.0 * filled / cells) +
                        " % of its cells: the object is modelled as a layer of surface cells. Take "
                        "smaller cells, or thicken the mesh");
}

}  // namespace

std::vector<CoveredCell> coverSurface(const TriangleMesh& surface, const VoxelLayout& layout,
                                      const VoxelizeOptions& o,
                                      std::vector<std::string>* messages) {
  Coverage coverage;
  const int orientation = signedVolume(surface) < 0.0 ? -1 : 1;
  if (orientation < 0)
    messages->push_back("the faces point inwards; they are taken the other way round");
  coverage.occupancy = Occupancy(layout.count * o.samples_per_edge);
  for (int axis = 0; axis < 3; ++axis)
    scanAxis(surface, layout, o.samples_per_edge, axis, orientation, &coverage);

  constexpr double kMargin = 1e-6;  // of a cell: faces in a lattice plane touch neither side
  std::vector<bool> touched = touchedCells(surface, layout, kMargin);
  std::vector<CoveredCell> cells;
  double filled = 0.0;
  for (int attempt = 0; cells.empty() && attempt < 2; ++attempt) {
    if (attempt == 1) touched = touchedCells(surface, layout, -kMargin);
    for (int k = 0; k < layout.count.z(); ++k)
      for (int j = 0; j < layout.count.y(); ++j)
        for (int i = 0; i < layout.count.x(); ++i) {
          const int index = layout.index(i, j, k);
          const double fraction = cellFraction(coverage, index);
          if (!touched[index] && !(fraction > o.min_fraction)) continue;
          CoveredCell cell;
          cell.position = {i, j, k};
          cell.fraction = fraction < 0.0 ? 1.0 : std::min(1.0, fraction);
          filled += cell.fraction;
          cells.push_back(cell);
        }
  }
  report(coverage, filled, cells.size(), messages);
  // A sheet without any volume still has to weigh and to resist something.
  if (filled <= 1e-6 * cells.size())
    for (CoveredCell& cell : cells) cell.fraction = 1.0;
  return separateBranches(cells, coverage.occupancy, o.samples_per_edge, o.separate_branches);
}

}  // namespace calipso::fem
