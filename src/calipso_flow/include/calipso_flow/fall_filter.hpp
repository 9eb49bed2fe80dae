#pragma once

#include <optional>

#include "calipso_flow/motion_filter.hpp"

namespace calipso::flow {

// Where a body that was let go is next: a Kalman filter of free fall with a steady spin over the
// poses since it was last pushed. What two poses say of a velocity errs by both; all of them, and
// known gravity, tell where it is to be looked for also after some frames without it.
class FallFilter {
 public:
  // @pre measurements come in order of time
  void take(const PoseMeasurement& measurement, const MotionPrior& prior);
  // Some poses in a row were where the fall had them, and it is not long unseen: what was not seen
  // may have landed.
  bool holds(double time) const;
  // The pose is where the fall has it. @pre as at()
  bool expects(const PoseMeasurement& measurement) const;
  // @pre take() was called, and `time` is not before the last measurement
  MotionState at(double time) const;

 private:
  MotionPiece piece_;
  std::optional<MotionState> state_;
  int agreed_ = 0;
};

}  // namespace calipso::flow
