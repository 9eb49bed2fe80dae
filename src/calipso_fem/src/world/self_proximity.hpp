#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

#include "calipso_fem/embedding.hpp"
#include "calipso_fem/world/surface_tree.hpp"
#include "fold_test.hpp"

namespace calipso::fem {

// What of a deformable object's closed surface may meet itself, and where it does. A vertex and a
// triangle are one piece, and never meet, where they are near each other at rest or where one node
// carries both. Others meet where they face each other: the vertex is in front of the triangle, and
// looks the other way.
class SelfProximity {
 public:
  using Vertices = decltype(TriangleMesh::vertices);

  // rest: the surface without load, closed, faces outwards
  SelfProximity(const TriangleMesh& rest, const Embedding& embedding);

  // Nearest triangle within `reach` that the vertex faces when it is at `at`; pairs nearer than
  // `apart` at rest are one piece. Depths count up to `depth` more than what is shallow.
  std::optional<SurfaceHit> nearest(const SurfaceTree& surface, int vertex,
                                    const Eigen::Vector3d& at, double reach, double apart,
                                    double depth) const;
  // All triangles that the vertex faces from outside, within `reach`.
  std::vector<SurfaceHit> ahead(const SurfaceTree& surface, int vertex, double reach,
                                double apart) const;
  // Sides of triangles that enter others, no pieces of their own, and end more than `depth` (m)
  // behind them.
  int crossings(const SurfaceTree& surface, double apart, double depth) const;
  // What depths count up to, m.
  double shallow(double apart) const;

  // Nothing can meet itself: a sheet that is not folded,
  bool isUnfolded(const SurfaceTree& surface);
  // vertices outside of the folded patches of one, when none goes further than its `ways` (m) and
  // others matter within `margin` (m),
  std::vector<int> mayMeet(const SurfaceTree& surface, const Eigen::VectorXd& ways, double margin) {
    return fold_.mayMeet(surface, ways, margin);
  }
  // or a surface that has hardly changed its shape since it was last found to be far from itself,
  // in a step in which no two of its points approach by more than `travel` (m).
  bool staysFar(const SurfaceTree& surface, const Eigen::Isometry3d& motion, double travel) const;
  // The surface, `vertices` of it searched as far as `spare()` beyond what matters, was found to be
  // far from itself or not.
  void searched(const SurfaceTree& surface, const Eigen::Isometry3d& motion, size_t vertices,
                bool far);
  double spare() const { return spare_; }
  long searches() const { return searches_; }

 private:
  bool onePiece(int vertex, int triangle, double apart) const;
  bool shareANode(int vertex, int triangle) const;

  TriangleMesh rest_;
  std::vector<std::array<int, 8>> nodes_;  // that carry a vertex, ascending; -1: fewer
  FoldTest fold_;
  double thickness_;  // m, of the material: twice its volume over its surface
  double spare_;      // m
  long searches_ = 0;
  struct Far {
    Vertices vertices;
    Eigen::Isometry3d motion;
  };
  std::optional<Far> far_;  // where the surface was last found to be far from itself
};

// Sides of triangles that go through others, with which they share no corner, and end more than
// `depth` (m) behind.
int crossings(const SurfaceTree& surface, double depth);

}  // namespace calipso::fem
