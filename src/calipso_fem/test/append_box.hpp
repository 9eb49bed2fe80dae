#pragma once

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

inline void appendBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high, TriangleMesh* mesh) {
  static const int kFaces[12][3] = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5},
                                    {0, 1, 5}, {0, 5, 4}, {2, 6, 7}, {2, 7, 3},
                                    {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  const int first = mesh->vertexCount(), face = mesh->triangleCount();
  mesh->vertices.conservativeResize(first + 8, 3);
  mesh->triangles.conservativeResize(face + 12, 3);
  for (int c = 0; c < 8; ++c)
    mesh->vertices.row(first + c) << (c & 1 ? high : low).x(), (c & 2 ? high : low).y(),
        (c & 4 ? high : low).z();
  for (int t = 0; t < 12; ++t)
    mesh->triangles.row(face + t) << first + kFaces[t][0], first + kFaces[t][1],
        first + kFaces[t][2];
}

}  // namespace calipso::fem
