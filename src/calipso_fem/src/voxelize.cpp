#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <stdexcept>

#include "calipso_fem/voxel_grid.hpp"
#include "column_scan.hpp"
#include "voxel_cells.hpp"

namespace calipso::fem {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

void checkInput(const TriangleMesh& surface, const VoxelizeOptions& o) {
  if (surface.vertexCount() == 0 || surface.triangleCount() == 0)
    throw std::invalid_argument("voxelize: the mesh has no vertices or no triangles");
  if (!surface.vertices.allFinite())
    throw std::invalid_argument("voxelize: a vertex is not finite; check the mesh file");
  if (surface.triangles.minCoeff() < 0 || surface.triangles.maxCoeff() >= surface.vertexCount())
    throw std::invalid_argument("voxelize: a triangle names a vertex that does not exist");
  if (!(o.cell_size >= 0.0) || !std::isfinite(o.cell_size))
    throw std::invalid_argument("voxelize: cell_size is " + std::to_string(o.cell_size) +
                                " m, allowed is >= 0 (0: chosen)");
  if (o.cell_size == 0.0 && o.target_nodes < 8)
    throw std::invalid_argument("voxelize: target_nodes is " + std::to_string(o.target_nodes) +
                                ", allowed is >= 8");
  if (o.has_anchor && !o.anchor.allFinite())
    throw std::invalid_argument("voxelize: the anchor is not finite");
  if (o.samples_per_edge < 1 || o.samples_per_edge > 16)
    throw std::invalid_argument("voxelize: samples_per_edge is " +
                                std::to_string(o.samples_per_edge) + ", allowed is 1..16");
  if (!(o.min_fraction > 0.0 && o.min_fraction <= 1.0))
    throw std::invalid_argument("voxelize: min_fraction is " + std::to_string(o.min_fraction) +
                                ", allowed is (0, 1]");
}

// Without faces that have no area and without second copies of a face, whichever way they are
// turned: either would make sight lines enter the solid more often than they leave it.
TriangleMesh withoutBadFaces(const TriangleMesh& surface, std::vector<std::string>* messages) {
  TriangleMesh clean = surface;
  std::set<std::array<int, 3>> known;
  int kept = 0, flat = 0, copies = 0;
  for (int face = 0; face < surface.triangleCount(); ++face) {
    const Eigen::RowVector3i t = surface.triangles.row(face);
    const Vector3d ab = surface.vertex(t[1]) - surface.vertex(t[0]);
    const Vector3d ac = surface.vertex(t[2]) - surface.vertex(t[0]);
    constexpr double kNoAngle = 1e-12;
    std::array<int, 3> corners = {t[0], t[1], t[2]};
    std::sort(corners.begin(), corners.end());
    if (!(ab.cross(ac).norm() > kNoAngle * std::max(ab.squaredNorm(), ac.squaredNorm()))) {
      ++flat;
    } else if (!known.insert(corners).second) {
      ++copies;
    } else {
      clean.triangles.row(kept++) = t;
    }
  }
  clean.triangles.conservativeResize(kept, 3);
  if (flat > 0) messages->push_back(std::to_string(flat) + " faces without area are left out");
  if (copies > 0)
    messages->push_back(std::to_string(copies) + " faces that repeat another one are left out");
  if (kept == 0)
    throw std::invalid_argument("voxelize: no face of the mesh has an area; give a surface");
  return clean;
}

VoxelLayout makeLayout(const TriangleMesh& surface, double h, const VoxelizeOptions& o) {
  const Vector3d low = surface.vertices.colwise().minCoeff();
  const Vector3d high = surface.vertices.colwise().maxCoeff();
  VoxelLayout layout;
  layout.cell_size = h;
  for (int a = 0; a < 3; ++a) {
    const double extent = high[a] - low[a];
    layout.count[a] = std::max(1, static_cast<int>(std::ceil(extent / h - 1e-9)));
    layout.origin[a] = 0.5 * (low[a] + high[a]) - 0.5 * h * layout.count[a];
    if (!o.has_anchor) continue;
    layout.origin[a] = o.anchor[a] + h * std::floor((low[a] - o.anchor[a]) / h + 1e-9);
    layout.count[a] =
        std::max(1, static_cast<int>(std::ceil((high[a] - layout.origin[a]) / h - 1e-9)));
  }
  constexpr double kMostCells = 2e8;
  if (layout.count.cast<double>().prod() > kMostCells)
    throw std::invalid_argument("voxelize: cell_size " + std::to_string(h) +
                                " m needs too many cells for an object of " +
                                std::to_string((high - low).norm()) + " m; take larger cells");
  return layout;
}

// Numbers the corners of the cells that are kept, in lattice order.
VoxelGrid makeGrid(const VoxelLayout& layout, const std::vector<CoveredCell>& cells,
                   double min_fraction) {
  VoxelGrid grid;
  grid.cell_size = layout.cell_size;
  grid.origin = layout.origin;
  const CornerNumbering numbering = numberCorners(cells);
  grid.hexes = numbering.hexes;
  grid.cell_lattice.resize(cells.size(), 3);
  grid.fraction.resize(cells.size());
  grid.point_share.resize(cells.size(), 8);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    grid.cell_lattice.row(c) = cells[c].position.transpose();
    for (int o = 0; o < 8; ++o) grid.point_share(c, o) = cells[c].share[o];
    grid.fraction[c] = std::clamp(cells[c].fraction, min_fraction, 1.0);
  }
  grid.node_lattice = numbering.node_lattice;
  grid.nodes =
      (grid.node_lattice.cast<double>() * layout.cell_size).rowwise() + layout.origin.transpose();
  return grid;
}

VoxelGrid voxelizeAt(const TriangleMesh& surface, double h, const VoxelizeOptions& o,
                     std::vector<std::string> messages) {
  const VoxelLayout layout = makeLayout(surface, h, o);
  const std::vector<CoveredCell> cells = coverSurface(surface, layout, o, &messages);
  VoxelGrid grid = makeGrid(layout, cells, o.min_fraction);
  grid.messages = std::move(messages);
  return grid;
}

// First guess from the bounding box; refined by counting.
double startCellSize(const TriangleMesh& surface, int target_nodes) {
  const Vector3d extent =
      surface.vertices.colwise().maxCoeff() - surface.vertices.colwise().minCoeff();
  const double largest = extent.maxCoeff();
  if (!(largest > 0.0)) throw std::invalid_argument("voxelize: all vertices lie in one point");
  const double volume = extent.cwiseMax(1e-2 * largest).prod();
  return std::min(largest, std::cbrt(volume / target_nodes));
}

}  // namespace

VolumeMesh VoxelGrid::mesh() const {
  VolumeMesh m;
  m.nodes = nodes;
  m.cells = hexes;
  m.fraction = fraction;
  m.point_share = point_share;
  m.lattice = node_lattice;
  return m;
}

VoxelGrid voxelize(const TriangleMesh& given, const VoxelizeOptions& options) {
  checkInput(given, options);
  std::vector<std::string> repairs;
  const TriangleMesh surface = withoutBadFaces(given, &repairs);
  if (options.cell_size > 0.0) return voxelizeAt(surface, options.cell_size, options, repairs);
  // Fixed point on the node count; the best of a few tries is kept.
  constexpr int kTries = 6;
  double h = startCellSize(surface, options.target_nodes);
  VoxelGrid best;
  for (int i = 0; i < kTries; ++i) {
    VoxelGrid grid = voxelizeAt(surface, h, options, repairs);
    const double ratio = static_cast<double>(grid.nodeCount()) / options.target_nodes;
    const bool better =
        best.nodeCount() == 0 ||
        std::abs(std::log(ratio)) <
            std::abs(std::log(static_cast<double>(best.nodeCount()) / options.target_nodes));
    if (better) best = std::move(grid);
    if (std::abs(std::log(ratio)) < 0.03) break;
    h *= std::cbrt(ratio);
  }
  return best;
}

}  // namespace calipso::fem
