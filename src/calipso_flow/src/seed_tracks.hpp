#pragma once

#include <vector>

#include "calipso_flow/look_match.hpp"
#include "calipso_flow/object_tracker.hpp"

namespace calipso::flow {

// Follows the reference's seeds into the frame, the object's look being warped to `look` and the
// object expected at `start`.
// @param diagonal  m, of the object
// @param found     gets a correspondence per track
std::vector<Track> followSeeds(const LookMatch& match, const ReferenceView& reference,
                               const Camera& camera, const Eigen::Isometry3d& look,
                               const Eigen::Isometry3d& start, const TrackerParams& params,
                               double diagonal, std::vector<Correspondence>& found);

}  // namespace calipso::flow
