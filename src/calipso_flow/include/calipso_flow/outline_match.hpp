#pragma once

#include <vector>

#include "calipso_flow/deformation_fit.hpp"
#include "calipso_flow/frame.hpp"
#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

// Where the outline of a deformed surface lies in a frame: at points of its silhouette the step from
// the object's look to what is behind it is located across the outline. Along the outline a match
// says nothing, and its covariance says so.
// @param deformed  #V x 3, object frame
// @param look      the object's look warped to `deformed`
std::vector<SurfaceMatch> matchOutline(const TriangleMesh& mesh,
                                       const decltype(TriangleMesh::vertices)& deformed,
                                       const ReferenceView::Warped& look, const Frame& frame,
                                       const Eigen::Isometry3d& world_from_object);

}  // namespace calipso::flow
