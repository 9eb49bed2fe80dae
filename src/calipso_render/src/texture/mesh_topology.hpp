#pragma once

#include <vector>

#include "calipso_render/edge_coverage.hpp"

namespace calipso::render {

// The first vertex at the place of each; places closer than a few millionths of the mesh's extent
// are one.
std::vector<int> weld(const Points& vertices);

Eigen::AlignedBox3f boxOf(const Points& points);

// Per triangle the number of the connected part of the mesh that it belongs to.
std::vector<int> connectedParts(const Points& vertices, const Triangles& triangles);

// The same of the part within which no crease is crossed: the outside of a bowl, a side of a box.
std::vector<int> smoothParts(const Points& vertices, const Triangles& triangles);

// How the triangles of a mesh that encloses space wind, seen from outside: 1 counterclockwise, -1
// clockwise. 0: the mesh is open somewhere, or its parts do not agree, so that either side of a
// triangle can be seen.
int outsideWinding(const Points& vertices, const Triangles& triangles);

// How far points spread where they spread least, to where they spread most (standard deviations).
float flatness(const Points& points);

// Is a mesh as thin as cloth, closed or not?
bool isSheet(const Points& vertices, const Triangles& triangles);

// Where a mesh's normals differ: a vertex has one for every piece of surface around it that no
// crease parts from the others. The first has the vertex' own number, further ones follow behind
// all vertices.
struct MeshNormals {
  Triangles corners;           // per triangle: the numbers of its corners' normals
  std::vector<int> vertex_of;  // per number
};

// @param edges meshEdges(triangles)
MeshNormals meshNormals(const Points& vertices, const Triangles& triangles,
                        const std::vector<MeshEdge>& edges);

}  // namespace calipso::render
