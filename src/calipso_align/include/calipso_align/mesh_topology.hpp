#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::align {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;  // #P x 3, m
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;  // #F x 3

// The edges of a mesh and the faces on both sides of each. Any triangle soup is accepted: an edge
// may border one face or many.
class MeshTopology {
 public:
  struct Edge {
    int v0, v1;
    std::vector<int> faces;
  };

  explicit MeshTopology(const Triangles& triangles);

  const Triangles& triangles() const { return triangles_; }
  const std::vector<Edge>& edges() const { return edges_; }
  // Which closed shell a face belongs to, numbered from 0; kOpen in pieces where an edge borders
  // anything but two faces that are wound alike.
  static constexpr int kOpen = -1;
  const std::vector<int>& shells() const { return shells_; }

 private:
  Triangles triangles_;
  std::vector<Edge> edges_;
  std::vector<int> shells_;
};

}  // namespace calipso::align
