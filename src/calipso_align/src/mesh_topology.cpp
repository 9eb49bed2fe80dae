#include "calipso_align/mesh_topology.hpp"

#include "calipso_scene/disjoint_sets.hpp"
#include "calipso_scene/half_edges.hpp"

namespace calipso::align {
namespace {

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
    Edge edge{first->low, first->high, {}};
    for (; last != end && last->low == edge.v0 && last->high == edge.v1; ++last) {
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
