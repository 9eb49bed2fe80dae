#include "calipso_align/mesh_topology.hpp"

#include <algorithm>
#include <tuple>

#include "calipso_scene/disjoint_sets.hpp"

namespace calipso::align {
namespace {

struct HalfEdge {
  int v0, v1, face;
  bool forward;  // the face is wound from v0 to v1
};

// Those of one edge side by side.
std::vector<HalfEdge> sortedHalfEdges(const Triangles& triangles) {
  std::vector<HalfEdge> half_edges;
  half_edges.reserve(3 * triangles.rows());
  for (int f = 0; f < triangles.rows(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int a = triangles(f, k), b = triangles(f, (k + 1) % 3);
      half_edges.push_back({std::min(a, b), std::max(a, b), f, a < b});
    }
  }
  std::sort(half_edges.begin(), half_edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.v0, a.v1, a.face, a.forward) < std::tie(b.v0, b.v1, b.face, b.forward);
  });
  return half_edges;
}

// Whether an edge, whose half edges these are, is passed once each way.
bool isClosed(const HalfEdge* first, const HalfEdge* last) {
  return last - first == 2 && first[0].forward != first[1].forward;
}

}  // namespace

MeshTopology::MeshTopology(const Triangles& triangles)
    : triangles_(triangles), shells_(triangles.rows()) {
  const std::vector<HalfEdge> half_edges = sortedHalfEdges(triangles);
  DisjointSets pieces(static_cast<int>(triangles.rows()));
  std::vector<int> at_open_edges;  // faces
  const HalfEdge* const end = half_edges.data() + half_edges.size();
  for (const HalfEdge *first = half_edges.data(), *last = first; first != end; first = last) {
    Edge edge{first->v0, first->v1, {}};
    for (; last != end && last->v0 == edge.v0 && last->v1 == edge.v1; ++last) {
      edge.faces.push_back(last->face);
      pieces.join(first->face, last->face);
    }
    if (!isClosed(first, last)) at_open_edges.push_back(first->face);
    edges_.push_back(std::move(edge));
  }
  std::vector<bool> open(shells_.size(), false);
  for (const int f : at_open_edges) open[pieces.find(f)] = true;
  int count = 0;
  for (int f = 0; f < static_cast<int>(shells_.size()); ++f) {
    const int first = pieces.find(f);  // the smallest face of its piece
    shells_[f] = open[first] ? kOpen : first == f ? count++ : shells_[first];
  }
}

}  // namespace calipso::align
