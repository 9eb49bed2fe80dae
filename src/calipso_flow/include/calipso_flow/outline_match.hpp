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

// A point of an object's silhouette and the step from the object's look to what is behind it there.
struct OutlineStep {
  Eigen::Vector3d rest;     // object frame, undeformed, m
  Eigen::Vector2d pixel;    // where the silhouette is taken to be
  Eigen::Vector2d outward;  // unit, in the picture
  double distance = 0.0;    // px, of the step from there, outwards
  double variance = 0.0;    // px^2, of distance

  // Along the outline a match says nothing, and its covariance says so.
  // @param expected  px: the distance of a silhouette that is where it is taken to be
  SurfaceMatch match(double expected = 0.0) const;
};

// Where the outline of a deformed surface lies in a frame: at points of its silhouette the step is
// located across it.
// @param deformed  #V x 3, object frame
// @param look      the object's look warped to `deformed`
std::vector<OutlineStep> findOutline(const std::vector<SurfaceEdge>& edges,
                                     const TriangleMesh& mesh,
                                     const decltype(TriangleMesh::vertices)& deformed,
                                     const ReferenceView::Warped& look, const Frame& frame,
                                     const Eigen::Isometry3d& world_from_object);

// How far off the steps of a silhouette lie that is where it is taken to be: an object's shading
// towards its rim, and what is behind it, move them, by directions in the picture.
class OutlineBias {
 public:
  OutlineBias() = default;
  explicit OutlineBias(const std::vector<OutlineStep>& steps);
  double towards(const Eigen::Vector2d& outward) const;  // px

 private:
  Eigen::Vector3d harmonics_ = Eigen::Vector3d::Zero();  // px: of 1, cosine and sine
};

}  // namespace calipso::flow
