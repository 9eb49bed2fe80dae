#include "mesh_repair.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "calipso_scene/half_edges.hpp"

namespace calipso {
namespace {

// A vertex that no face names is no part of the surface, and may lie anywhere. It stays, for the
// order of the vertices, at the place of one that is.
void gatherStrays(TriangleMesh* mesh) {
  std::vector<bool> used(mesh->vertexCount(), false);
  for (int f = 0; f < mesh->triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) used[mesh->triangles(f, k)] = true;
  for (int i = 0; i < mesh->vertexCount(); ++i)
    if (!used[i]) mesh->vertices.row(i) = mesh->vertices.row(mesh->triangles(0, 0)).eval();
}

void dropUselessFaces(TriangleMesh* mesh) {
  std::set<std::array<int, 3>> seen;
  int kept = 0;
  for (int f = 0; f < mesh->triangleCount(); ++f) {
    std::array<int, 3> t{mesh->triangles(f, 0), mesh->triangles(f, 1), mesh->triangles(f, 2)};
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    // The same corners the other way round are the back of a sheet.
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    if (seen.insert(t).second) mesh->triangles.row(kept++) = mesh->triangles.row(f).eval();
  }
  mesh->triangles.conservativeResize(kept, 3);
}

// What two faces that share an edge, and share it with no other, say of each other.
struct Neighbour {
  int face;
  bool alike;  // wound alike
};

struct Surface {
  std::vector<std::vector<Neighbour>> neighbours;  // of every face
  std::vector<bool> whole;                         // every edge of the face has one neighbour
};

Surface surfaceOf(const TriangleMesh& mesh) {
  Surface surface{std::vector<std::vector<Neighbour>>(mesh.triangleCount()),
                  std::vector<bool>(mesh.triangleCount(), true)};
  const std::vector<HalfEdge> edges = sortedHalfEdges(mesh.triangles);
  for (size_t i = 0, end = 0; i < edges.size(); i = end) {
    for (end = i;
         end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high;)
      ++end;
    if (end - i == 2) {
      const HalfEdge &a = edges[i], &b = edges[i + 1];
      surface.neighbours[a.face].push_back({b.face, a.forward != b.forward});
      surface.neighbours[b.face].push_back({a.face, a.forward != b.forward});
    } else {
      for (size_t k = i; k < end; ++k) surface.whole[edges[k].face] = false;
    }
  }
  return surface;
}

// Six times the volume between a face and the origin.
double volumeBelow(const TriangleMesh& mesh, int face, const Eigen::RowVector3d& origin) {
  const auto corner = [&](int k) -> Eigen::Vector3d {
    return (mesh.vertices.row(mesh.triangles(face, k)) - origin).transpose();
  };
  return corner(0).dot(corner(1).cross(corner(2)));
}

constexpr int kUnseen = -1, kKept = 0, kTurned = 1;

// Winds the piece of the surface that the face `first` belongs to; says of its faces what was done.
void windPiece(const Surface& surface, int first, std::vector<int>* done, TriangleMesh* mesh) {
  std::vector<int> piece{first};
  (*done)[first] = kKept;
  for (size_t i = 0; i < piece.size(); ++i) {
    for (const Neighbour& n : surface.neighbours[piece[i]]) {
      if ((*done)[n.face] != kUnseen) continue;
      const int own = (*done)[piece[i]];
      (*done)[n.face] = n.alike ? own : kTurned - own;
      piece.push_back(n.face);
    }
  }
  size_t turned = 0;
  bool closed = true;
  double volume = 0.0;
  const Eigen::RowVector3d origin = mesh->vertices.row(mesh->triangles(first, 0));
  for (const int f : piece) {
    turned += (*done)[f];
    closed = closed && surface.whole[f];
    volume += ((*done)[f] == kTurned ? -1.0 : 1.0) * volumeBelow(*mesh, f, origin);
  }
  if (turned == 0) return;
  const bool wrong_way = closed ? volume < 0.0 : 2 * turned > piece.size();
  for (const int f : piece)
    if (((*done)[f] == kTurned) != wrong_way)
      std::swap(mesh->triangles(f, 1), mesh->triangles(f, 2));
}

// Whether every edge is passed as often one way as the other.
bool isClosed(const TriangleMesh& mesh) {
  const std::vector<HalfEdge> edges = sortedHalfEdges(mesh.triangles);
  for (size_t i = 0; i < edges.size();) {
    const HalfEdge& first = edges[i];
    int balance = 0;
    for (; i < edges.size() && edges[i].low == first.low && edges[i].high == first.high; ++i)
      balance += edges[i].forward ? 1 : -1;
    if (balance != 0) return false;
  }
  return true;
}

}  // namespace

void repairMesh(TriangleMesh* mesh) {
  gatherStrays(mesh);
  dropUselessFaces(mesh);
  const Surface surface = surfaceOf(*mesh);
  std::vector<int> done(mesh->triangleCount(), kUnseen);
  for (int f = 0; f < mesh->triangleCount(); ++f)
    if (done[f] == kUnseen) windPiece(surface, f, &done, mesh);
  if (isClosed(*mesh) && signedVolume(*mesh) < 0.0)
    mesh->triangles.col(1).swap(mesh->triangles.col(2));
}

}  // namespace calipso
