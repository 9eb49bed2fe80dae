#pragma once

#include <vector>

#include "calipso_flow/motion_filter.hpp"

namespace calipso::flow {

// The likeliest division of a motion into pieces of a few plain kinds, over all divisions at once, by
// dynamic programming over the frame that a piece ends with: the state that the best pieces up to there
// lead to is all that goes on. Instants are good to a part of a frame, and kinds to their family.
// @param cut_times  s; pieces end there
// @param least_evidence  log of the odds by which a piece more must raise the likelihood
std::vector<MotionPiece> likeliestPieces(const std::vector<PoseMeasurement>& measurements,
                                         const std::vector<double>& cut_times, const MotionPrior& prior,
                                         double noise_scale, double least_evidence);

}  // namespace calipso::flow
