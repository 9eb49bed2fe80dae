#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso {

// One side of an edge: the edge as one face has it.
struct HalfEdge {
  int low, high;  // vertices of the edge, low < high unless it is degenerate
  int face;
  bool forward;  // the face is wound from low to high
};

// The half edges of `triangles` (#F x 3), those of one edge side by side.
std::vector<HalfEdge> sortedHalfEdges(
    const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles);

}  // namespace calipso
