#pragma once

#include <vector>

#include "calipso_flow/deformation_fit.hpp"
#include "calipso_flow/frame.hpp"
#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

// An edge of a mesh with the triangles beside it; -1: there is none.
struct SurfaceEdge {
  int from, to, left, right;
};

// In order of their vertices. Edges of more than two triangles are left out.
std::vector<SurfaceEdge> edgesOf(const TriangleMesh& mesh);

// Where the outline of a deformed surface lies in a frame: at points of its silhouette the step from
// the object's look to what is behind it is located across the outline. Along the outline a match
// says nothing, and its covariance says so.
// @param deformed  #V x 3, object frame
// @param look      the object's look warped to `deformed`
std::vector<SurfaceMatch> matchOutline(const std::vector<SurfaceEdge>& edges,
                                       const TriangleMesh& mesh,
                                       const decltype(TriangleMesh::vertices)& deformed,
                                       const ReferenceView::Warped& look, const Frame& frame,
                                       const Eigen::Isometry3d& world_from_object);

}  // namespace calipso::flow
