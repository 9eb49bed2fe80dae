#pragma once

#include <calipso_fem/embedding.hpp>
#include <calipso_fem/world/wind.hpp>

namespace calipso::flow {

// What of a sheet stands in the wind, in few triangles: its vertices are put together in cubes of
// the given edge. Front and back, which feel the same, become one. The area that this costs is made
// up for by the drag.
struct SheetSkin {
  // @param edge  m; 0: the surface as it is
  // @throw std::invalid_argument where nothing of the surface is left
  SheetSkin(const TriangleMesh& surface, const fem::VoxelGrid& grid, double edge);

  fem::Triangles triangles;
  fem::Embedding embedding;  // of its vertices in the grid
  double drag = 0.0;         // kg/m^3
};

double surfaceArea(const TriangleMesh& mesh);  // m^2

}  // namespace calipso::flow
