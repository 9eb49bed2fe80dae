#include <algorithm>
#include <numeric>
#include <tuple>

#include "calipso_align/silhouette.hpp"

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

// Pieces of faces that share edges; a piece is open where one of its edges is.
class Pieces {
 public:
  explicit Pieces(int faces) : parent_(faces), open_(faces, false) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  void join(int f, int g) {
    const auto [a, b] = std::minmax({rootOf(f), rootOf(g)});
    parent_[b] = a;
    open_[a] = open_[a] || open_[b];
  }
  void open(int f) { open_[rootOf(f)] = true; }
  std::vector<int> closedShells() {
    std::vector<int> shells(parent_.size());
    int count = 0;
    for (int f = 0; f < static_cast<int>(shells.size()); ++f) {
      const int root = rootOf(f);
      shells[f] = open_[root] ? MeshTopology::kOpen : root == f ? count++ : shells[root];
    }
    return shells;
  }

 private:
  int rootOf(int f) {
    while (parent_[f] != f) f = parent_[f] = parent_[parent_[f]];
    return f;
  }
  std::vector<int> parent_;
  std::vector<bool> open_;
};

}  // namespace

MeshTopology::MeshTopology(const Triangles& triangles) : triangles_(triangles) {
  const std::vector<HalfEdge> half_edges = sortedHalfEdges(triangles);
  Pieces pieces(static_cast<int>(triangles.rows()));
  const HalfEdge* const end = half_edges.data() + half_edges.size();
  for (const HalfEdge *first = half_edges.data(), *last = first; first != end; first = last) {
    Edge edge{first->v0, first->v1, {}};
    for (; last != end && last->v0 == edge.v0 && last->v1 == edge.v1; ++last) {
      edge.faces.push_back(last->face);
      pieces.join(first->face, last->face);
    }
    if (!isClosed(first, last)) pieces.open(first->face);
    edges_.push_back(std::move(edge));
  }
  shells_ = pieces.closedShells();
}

}  // namespace calipso::align
