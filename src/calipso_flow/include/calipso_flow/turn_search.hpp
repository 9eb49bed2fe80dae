#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_flow/pose_fit.hpp"
#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

// Where an object may be that is not where it was expected.
struct TurnSearch {
  Eigen::Isometry3d predicted;  // world_from_object
  Eigen::Vector3d pivot;        // object frame, m; what it turns about
  Eigen::AlignedBox2d reach;    // px by which the pivot may lie off in the picture
  double largest_turn = 1.6;    // rad, against the prediction
};

struct TurnedPose {
  Eigen::Isometry3d pose;  // world_from_object
  size_t reference;        // that shows most of the side seen then
};

// The likeliest poses, best first, over a grid of turns and all places within reach: by masked,
// normalised correlation of the references' looks with the frame, all at reduced size. They are
// good to half a step of the grid, for a finer match to start from.
// @param references  not empty
std::vector<TurnedPose> searchTurned(const std::vector<const ReferenceView*>& references,
                                     const Frame& frame, const TurnSearch& search, size_t count);

}  // namespace calipso::flow
