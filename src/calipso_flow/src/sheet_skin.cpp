#include "sheet_skin.hpp"

#include <algorithm>
#include <array>
#include <calipso_fem/world/mass_properties.hpp>
#include <calipso_fem/world/world_types.hpp>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

namespace calipso::flow {
namespace {

using Corners = std::array<int, 3>;

// The cube in which each vertex lies, and the mean of every cube's vertices.
std::vector<int> clustered(const TriangleMesh& surface, double edge, fem::NodeMatrix& means) {
  std::map<std::array<long, 3>, int> index;
  std::vector<int> cluster_of;
  std::vector<Eigen::Vector3d> sums;
  std::vector<int> counts;
  const Eigen::RowVector3d low = surface.vertices.colwise().minCoeff();
  for (int i = 0; i < surface.vertexCount(); ++i) {
    const Eigen::RowVector3d cell = (surface.vertices.row(i) - low) / edge;
    const std::array<long, 3> key{std::lround(cell.x()), std::lround(cell.y()),
                                  std::lround(cell.z())};
    const auto [at, added] = index.try_emplace(key, static_cast<int>(sums.size()));
    if (added) sums.push_back(Eigen::Vector3d::Zero()), counts.push_back(0);
    cluster_of.push_back(at->second);
    sums[at->second] += surface.vertex(i);
    ++counts[at->second];
  }
  means.resize(sums.size(), 3);
  for (size_t c = 0; c < sums.size(); ++c) means.row(c) = sums[c].transpose() / counts[c];
  return cluster_of;
}

}  // namespace

double surfaceArea(const TriangleMesh& mesh) {
  double doubled = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0));
    doubled +=
        (mesh.vertex(mesh.triangles(t, 1)) - a).cross(mesh.vertex(mesh.triangles(t, 2)) - a).norm();
  }
  return 0.5 * doubled;
}

SheetSkin::SheetSkin(const TriangleMesh& surface, const fem::VoxelGrid& grid, double edge) {
  const double sheet_area = (fem::isClosed(surface) ? 0.5 : 1.0) * surfaceArea(surface);
  TriangleMesh skin = surface;
  if (edge > 0.0) {
    fem::NodeMatrix means;
    const std::vector<int> cluster_of = clustered(surface, edge, means);
    std::set<Corners> kept;
    for (int t = 0; t < surface.triangleCount(); ++t) {
      Corners corners;
      for (int k = 0; k < 3; ++k) corners[k] = cluster_of[surface.triangles(t, k)];
      std::sort(corners.begin(), corners.end());
      if (corners[0] != corners[1] && corners[1] != corners[2]) kept.insert(corners);
    }
    skin.vertices = means;
    skin.triangles.resize(kept.size(), 3);
    Eigen::Index t = 0;
    for (const Corners& corners : kept)
      skin.triangles.row(t++) << corners[0], corners[1], corners[2];
  }
  const double area = surfaceArea(skin);
  if (!(area > 0.0))
    throw std::invalid_argument("sheet: cubes of " + std::to_string(edge) +
                                " m leave no surface of it");
  triangles = skin.triangles;
  embedding = fem::embed(skin.vertices, grid);
  drag = fem::kAirDrag * sheet_area / area;
}

}  // namespace calipso::flow
