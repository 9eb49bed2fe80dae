#pragma once

#include <algorithm>
#include <vector>

#include "calipso_flow/motion_filter.hpp"

namespace calipso::flow {

// Several impacts within a frame, as of a box that comes down on a corner and at once on an edge:
// between them it turns by more than one instant explains. Their duration as a share of a frame,
// and the log odds that they have to earn.
constexpr double kContactShare = 0.3, kContactEvidence = 4.0;

// Fewer frames in a piece tell nothing about its velocity. In the first and the last one of the
// clip and at a cut nothing is known before or after: two poses are always explained by some
// velocity, also when one is wrong.
inline int leastFrames(bool first, bool last) { return first || last ? 3 : 2; }

// Log of the odds by which a piece more must raise the likelihood that begins before a measurement.
// @param least  where nothing is known of what it may have struck
inline double evidenceBefore(const PoseMeasurement& measurement, double least) {
  return std::max(0.0, least - measurement.strikes);
}

// The likeliest division of a motion into pieces of a few plain kinds, over all divisions at once,
// by dynamic programming over the frame that a piece ends with: the state that the best pieces up
// to there lead to is all that goes on. Instants are good to a part of a frame, and kinds to their
// family.
// @param cut_times  s; pieces end there
// @param least_evidence  log of the odds by which a piece more must raise the likelihood
std::vector<MotionPiece> likeliestPieces(const std::vector<PoseMeasurement>& measurements,
                                         const std::vector<double>& cut_times,
                                         const MotionPrior& prior, double noise_scale,
                                         double least_evidence);

}  // namespace calipso::flow
