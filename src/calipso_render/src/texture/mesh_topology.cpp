#include "texture/mesh_topology.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "calipso_scene/disjoint_sets.hpp"

namespace calipso::render {
namespace {

constexpr float kSamePlace = 1e-5f;  // of the surface's extent

constexpr float kSheet = 0.012f;  // of the extent: mean thickness of a sheet

// cosine between the normals of two triangles: an edge that bends more is no smooth surface's
constexpr float kCrease = 0.5f;

using DirectedEdge = std::pair<int, int>;

// Every edge is walked once in each direction.
bool isClosed(std::vector<DirectedEdge> edges) {
  std::sort(edges.begin(), edges.end());
  if (std::adjacent_find(edges.begin(), edges.end()) != edges.end()) return false;
  return std::all_of(edges.begin(), edges.end(), [&](const DirectedEdge& e) {
    return std::binary_search(edges.begin(), edges.end(), DirectedEdge(e.second, e.first));
  });
}

Points flatNormals(const Points& vertices, const Triangles& triangles) {
  Points flat;
  for (const Eigen::Vector3i& t : triangles)
    flat.push_back((vertices[t[1]] - vertices[t[0]])
                       .cross(vertices[t[2]] - vertices[t[0]])
                       .stableNormalized());
  return flat;
}

}  // namespace

Eigen::AlignedBox3f boxOf(const Points& points) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : points) box.extend(p);
  return box;
}

std::vector<int> weld(const Points& vertices) {
  const float cell = std::max(kSamePlace * boxOf(vertices).diagonal().norm(), 1e-12f);
  using Numbered = std::pair<std::array<long, 3>, int>;  // a vertex's cell, and the vertex
  std::vector<Numbered> sorted(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    for (int k = 0; k < 3; ++k) sorted[i].first[k] = std::lround(vertices[i][k] / cell);
    sorted[i].second = static_cast<int>(i);
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> welded(vertices.size());
  const Numbered* first = sorted.data();  // of those in its cell
  for (const Numbered& vertex : sorted) {
    if (vertex.first != first->first) first = &vertex;
    welded[vertex.second] = first->second;
  }
  return welded;
}

std::vector<int> connectedParts(const Points& vertices, const Triangles& triangles) {
  const std::vector<int> place = weld(vertices);
  DisjointSets sets(static_cast<int>(vertices.size()));
  for (const Eigen::Vector3i& t : triangles) {
    sets.join(place[t[0]], place[t[1]]);
    sets.join(place[t[0]], place[t[2]]);
  }
  std::vector<int> parts;
  for (const Eigen::Vector3i& t : triangles) parts.push_back(sets.find(place[t[0]]));
  return parts;
}

std::vector<int> smoothParts(const Points& vertices, const Triangles& triangles) {
  const std::vector<int> place = weld(vertices);
  const Points flat = flatNormals(vertices, triangles);
  Triangles welded = triangles;
  for (Eigen::Vector3i& t : welded) t = t.unaryExpr([&](int vertex) { return place[vertex]; });
  DisjointSets sets(static_cast<int>(triangles.size()));
  for (const MeshEdge& e : meshEdges(welded)) {
    if (e.b >= 0 && flat[e.a].dot(flat[e.b]) >= kCrease) sets.join(e.a, e.b);
  }
  std::vector<int> parts;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    parts.push_back(sets.find(static_cast<int>(t)));
  return parts;
}

float flatness(const Points& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : points) sum += p.cast<double>();
  const Eigen::Vector3d mean = sum / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3f& p : points) {
    const Eigen::Vector3d d = p.cast<double>() - mean;
    spread += d * d.transpose();
  }
  const Eigen::Vector3d squares =  // ascending
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread, Eigen::EigenvaluesOnly).eigenvalues();
  return static_cast<float>(std::sqrt(std::max(0.0, squares[0]) / std::max(1e-30, squares[2])));
}

bool isSheet(const Points& vertices, const Triangles& triangles) {
  const Eigen::AlignedBox3f box = boxOf(vertices);
  const Eigen::Vector3f origin = box.center();
  float volume = 0.0f, area = 0.0f;
  for (const Eigen::Vector3i& t : triangles) {
    const Eigen::Vector3f& a = vertices[t[0]];
    const Eigen::Vector3f normal = 0.5f * (vertices[t[1]] - a).cross(vertices[t[2]] - a);
    volume += (a - origin).dot(normal) / 3.0f, area += normal.norm();
  }
  const float thickness = area > 0.0f ? 2.0f * std::abs(volume) / area : 0.0f;  // mean
  return thickness < kSheet * box.diagonal().norm();
}

MeshNormals meshNormals(const Points& vertices, const Triangles& triangles,
                        const std::vector<MeshEdge>& edges) {
  const Points flat = flatNormals(vertices, triangles);
  // Corners that no crease parts are one.
  const auto cornerAt = [&](int t, int vertex) {
    const Eigen::Vector3i& corners = triangles[t];
    return 3 * t + (corners[0] == vertex ? 0 : corners[1] == vertex ? 1 : 2);
  };
  DisjointSets pieces(3 * static_cast<int>(triangles.size()));
  for (const MeshEdge& e : edges) {
    if (e.b < 0 || flat[e.a].dot(flat[e.b]) < kCrease) continue;
    for (const int vertex : {e.from, e.to})
      pieces.join(cornerAt(e.a, vertex), cornerAt(e.b, vertex));
  }
  MeshNormals normals{triangles, std::vector<int>(vertices.size())};
  std::iota(normals.vertex_of.begin(), normals.vertex_of.end(), 0);
  std::vector<bool> taken(vertices.size(), false);
  std::vector<int> number(3 * triangles.size(), -1);  // per piece
  for (int c = 0; c < 3 * static_cast<int>(triangles.size()); ++c) {
    const int vertex = triangles[c / 3][c % 3];
    int& piece = number[pieces.find(c)];
    if (piece < 0 && taken[vertex]) {
      piece = static_cast<int>(normals.vertex_of.size());
      normals.vertex_of.push_back(vertex);
    } else if (piece < 0) {
      piece = vertex, taken[vertex] = true;
    }
    normals.corners[c / 3][c % 3] = piece;
  }
  return normals;
}

int outsideWinding(const Points& vertices, const Triangles& triangles) {
  const std::vector<int> place = weld(vertices);
  DisjointSets parts(static_cast<int>(vertices.size()));
  std::vector<DirectedEdge> edges;
  for (const Eigen::Vector3i& t : triangles) {
    const int a = place[t[0]], b = place[t[1]], c = place[t[2]];
    if (a == b || b == c || c == a) continue;  // without area
    edges.insert(edges.end(), {{a, b}, {b, c}, {c, a}});
    parts.join(a, b);
    parts.join(b, c);
  }
  if (edges.empty() || !isClosed(edges)) return 0;
  std::map<int, double> volumes;  // of the connected parts, six times
  for (const Eigen::Vector3i& t : triangles) {
    const Eigen::Vector3d a = vertices[t[0]].cast<double>(), b = vertices[t[1]].cast<double>(),
                          c = vertices[t[2]].cast<double>();
    volumes[parts.find(place[t[0]])] += a.dot(b.cross(c));
  }
  const bool outward =
      std::all_of(volumes.begin(), volumes.end(), [](const auto& v) { return v.second >= 0.0; });
  const bool inward =
      std::all_of(volumes.begin(), volumes.end(), [](const auto& v) { return v.second <= 0.0; });
  return outward == inward ? 0 : outward ? 1 : -1;
}

}  // namespace calipso::render
