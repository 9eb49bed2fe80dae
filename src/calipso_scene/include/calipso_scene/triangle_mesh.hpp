#pragma once

#include <Eigen/Core>
#include <string>

namespace calipso {

// A triangle surface mesh. Faces are counter-clockwise seen from outside.
struct TriangleMesh {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> vertices;  // #V x 3, m
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles;    // #F x 3, 0-based

  int vertexCount() const { return static_cast<int>(vertices.rows()); }
  int triangleCount() const { return static_cast<int>(triangles.rows()); }
  Eigen::Vector3d vertex(int i) const { return vertices.row(i).transpose(); }
};

// Reads a mesh. OBJ files keep their vertex order; other formats go through assimp, with equal
// vertices merged. Polygons are split; useless faces are left out, those wound wrongly are turned.
// @throw std::runtime_error naming the file, what is wrong in it and the remedy
TriangleMesh loadMesh(const std::string& path);

// Writes an OBJ file with every digit; loadMesh() repairs faces when it reads it. @throw
// std::runtime_error
void saveObj(const TriangleMesh& mesh, const std::string& path);

// Length of the bounding box's diagonal, m.
double boundingDiagonal(const TriangleMesh& mesh);

// Signed volume enclosed by a closed mesh, m^3; negative when the faces point inwards.
double signedVolume(const TriangleMesh& mesh);

// Area-weighted vertex normals, #V x 3, unit length (zero where a vertex has no face).
Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> vertexNormals(const TriangleMesh& mesh);

}  // namespace calipso
