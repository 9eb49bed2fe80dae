#include "calipso_scene/triangle_mesh.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <Eigen/Geometry>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "mesh_repair.hpp"

namespace calipso {

namespace {

using Points = std::vector<Eigen::Vector3d>;
using Faces = std::vector<Eigen::Vector3i>;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw std::runtime_error(path + ": " + what);
}

TriangleMesh toMesh(const std::string& path, const Points& points, const Faces& faces) {
  if (points.empty()) fail(path, "has no vertices; export the surface as triangles and try again");
  if (faces.empty()) fail(path, "has no faces; export the surface as triangles, not as points");
  TriangleMesh mesh;
  mesh.vertices.resize(static_cast<Eigen::Index>(points.size()), 3);
  mesh.triangles.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) {
    mesh.vertices.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  }
  for (std::size_t i = 0; i < faces.size(); ++i) {
    mesh.triangles.row(static_cast<Eigen::Index>(i)) = faces[i].transpose();
  }
  repairMesh(&mesh);
  if (mesh.triangleCount() == 0)
    fail(path, "has no face with three different corners; export the surface as triangles");
  return mesh;
}

Eigen::Vector3d parseVertex(const std::string& path, std::istream& line, int line_number) {
  Eigen::Vector3d p;
  if (!(line >> p.x() >> p.y() >> p.z()) || !p.allFinite()) {
    fail(path, "line " + std::to_string(line_number) +
                   " is not a vertex of three finite numbers; repair or re-export the file");
  }
  return p;
}

// Vertex indices of one `f` line, 0-based. OBJ counts from 1, negative ones from the end.
std::vector<int> parseFace(const std::string& path, std::istream& line, int face, int vertices) {
  std::vector<int> corners;
  std::string token;
  while (line >> token) {
    int index = 0;
    if (!(std::istringstream(token) >> index)) index = 0;
    const int corner = index > 0 ? index - 1 : vertices + index;
    if (index == 0 || corner < 0 || corner >= vertices) {
      fail(path, "face " + std::to_string(face) + " has index " + token + ", but there are " +
                     std::to_string(vertices) + " vertices before it; re-export the file");
    }
    corners.push_back(corner);
  }
  if (corners.size() < 3) {
    fail(path, "face " + std::to_string(face) + " has fewer than 3 corners; re-export the file");
  }
  return corners;
}

// The next line; a backslash at the end of one continues it. False at the end of the file.
bool readLine(std::istream& file, std::string* text, int* line_number) {
  if (!std::getline(file, *text)) return false;
  ++*line_number;
  for (std::string more; true; *text += ' ' + more, ++*line_number) {
    while (!text->empty() && text->back() == '\r') text->pop_back();
    if (text->empty() || text->back() != '\\') return true;
    text->pop_back();
    if (!std::getline(file, more)) return true;
  }
}

// NOTE: not through assimp, which reorders vertices and names no face in its errors.
TriangleMesh loadObj(const std::string& path) {
  std::ifstream file(path);
  if (!file) fail(path, "cannot be opened; check the path and the permissions");
  Points points;
  Faces faces;
  std::string text;
  int face = 0;
  for (int line_number = 0; readLine(file, &text, &line_number);) {
    std::istringstream line(text);
    std::string key;
    line >> key;
    if (key == "v") points.push_back(parseVertex(path, line, line_number));
    if (key != "f") continue;
    const auto corners = parseFace(path, line, ++face, static_cast<int>(points.size()));
    for (std::size_t k = 2; k < corners.size(); ++k) {
      faces.emplace_back(corners[0], corners[k - 1], corners[k]);
    }
  }
  return toMesh(path, points, faces);
}

TriangleMesh loadWithAssimp(const std::string& path) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(
      path, aiProcess_Triangulate | aiProcess_PreTransformVertices | aiProcess_SortByPType);
  if (!scene) fail(path, std::string("cannot be read as a mesh: ") + importer.GetErrorString());
  Points points;
  Faces faces;
  std::map<std::array<float, 3>, int> index_of;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    std::vector<int> merged(part.mNumVertices);
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const aiVector3D& p = part.mVertices[i];
      if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
        fail(path,
             "vertex " + std::to_string(i) + " is not finite; repair the model or export it again");
      const auto [entry, is_new] =
          index_of.try_emplace({p.x, p.y, p.z}, static_cast<int>(points.size()));
      if (is_new) points.emplace_back(p.x, p.y, p.z);
      merged[i] = entry->second;
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines bound no volume
      faces.emplace_back(merged[face.mIndices[0]], merged[face.mIndices[1]],
                         merged[face.mIndices[2]]);
    }
  }
  return toMesh(path, points, faces);
}

bool hasObjExtension(const std::string& path) {
  return path.size() > 4 &&
         (path.substr(path.size() - 4) == ".obj" || path.substr(path.size() - 4) == ".OBJ");
}

}  // namespace

TriangleMesh loadMesh(const std::string& path) {
  return hasObjExtension(path) ? loadObj(path) : loadWithAssimp(path);
}

void saveObj(const TriangleMesh& mesh, const std::string& path) {
  std::ofstream file(path);
  file << std::setprecision(std::numeric_limits<double>::max_digits10);
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    file << "v " << mesh.vertices(i, 0) << ' ' << mesh.vertices(i, 1) << ' ' << mesh.vertices(i, 2)
         << '\n';
  }
  for (int i = 0; i < mesh.triangleCount(); ++i) {
    file << "f " << mesh.triangles(i, 0) + 1 << ' ' << mesh.triangles(i, 1) + 1 << ' '
         << mesh.triangles(i, 2) + 1 << '\n';
  }
  if (!file) fail(path, "cannot be written; check that the folder exists and has space");
}

double boundingDiagonal(const TriangleMesh& mesh) {
  return (mesh.vertices.colwise().maxCoeff() - mesh.vertices.colwise().minCoeff()).norm();
}

double signedVolume(const TriangleMesh& mesh) {
  const Eigen::Vector3d origin = mesh.vertices.colwise().mean().transpose();
  double volume = 0.0;
  for (int i = 0; i < mesh.triangleCount(); ++i) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(i, 0)) - origin;
    const Eigen::Vector3d b = mesh.vertex(mesh.triangles(i, 1)) - origin;
    const Eigen::Vector3d c = mesh.vertex(mesh.triangles(i, 2)) - origin;
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return volume;
}

Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> vertexNormals(const TriangleMesh& mesh) {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> normals =
      Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>::Zero(mesh.vertexCount(), 3);
  for (int i = 0; i < mesh.triangleCount(); ++i) {
    const Eigen::Vector3i t = mesh.triangles.row(i).transpose();
    const Eigen::Vector3d a = mesh.vertex(t[0]);
    // The cross product's length is twice the area: summing it weights by area.
    const Eigen::Vector3d n = (mesh.vertex(t[1]) - a).cross(mesh.vertex(t[2]) - a);
    for (int k = 0; k < 3; ++k) normals.row(t[k]) += n.transpose();
  }
  for (int i = 0; i < normals.rows(); ++i) {
    const double length = normals.row(i).norm();
    if (length > 0.0) normals.row(i) /= length;
  }
  return normals;
}

}  // namespace calipso
