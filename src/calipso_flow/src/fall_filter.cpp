#include "calipso_flow/fall_filter.hpp"

namespace calipso::flow {
namespace {

constexpr double kSpinShare = 0.03;  // of the prior's: how fast a free body's spin changes
constexpr double kNoiseScale = 2.0;  // poses err by more than they state
constexpr double kSurprise = 22.46;  // chi-squared with 6 degrees of freedom, 99.9 %
constexpr int kSure = 4;             // poses in a row
constexpr double kUnseen = 0.4;      // s: so long it may go on falling

MotionPiece fallOf(const MotionPrior& prior) {
  MotionPiece piece;
  piece.travel = Travel::kFreeFall;
  piece.spin_noise = kSpinShare * prior.spin;
  return piece;
}

}  // namespace

void FallFilter::take(const PoseMeasurement& measurement, const MotionPrior& prior) {
  piece_ = fallOf(prior);
  if (!state_) {
    state_ = initialState(measurement.time, piece_, prior, measurement);
    correct(*state_, measurement, kNoiseScale);
    return;
  }
  MotionState next = predicted(*state_, measurement, piece_, kNoiseScale);
  ++agreed_;
  if (squaredSurprise(next, measurement, kNoiseScale) > kSurprise) {
    next = predicted(enterPiece(*state_, piece_, prior), measurement, piece_, kNoiseScale);
    agreed_ = 0;
  }
  correct(next, measurement, kNoiseScale);
  state_ = next;
}

bool FallFilter::holds(double time) const {
  return agreed_ >= kSure && time - state_->time < kUnseen;
}

bool FallFilter::expects(const PoseMeasurement& measurement) const {
  const MotionState next = predicted(*state_, measurement, piece_, kNoiseScale);
  return squaredSurprise(next, measurement, kNoiseScale) <= kSurprise;
}

MotionState FallFilter::at(double time) const { return predicted(*state_, time, piece_); }

}  // namespace calipso::flow
