#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "calipso_flow/motion_filter.hpp"

namespace calipso::flow {

// A sudden change of velocity or spin.
struct Collision {
  double time = 0.0;            // s
  double time_deviation = 0.0;  // s, standard
  MotionState before, after;    // at `time`
  // Speed of separation over speed of approach along the change of velocity; negative when the
  // object goes on in the direction it came; NaN when it rested and was struck.
  double restitution() const;
  // Standard. The velocities' errors are taken for independent, which makes it rather too large:
  // where it was at the impact puts both off in opposite directions.
  double restitutionDeviation() const;
};

struct TrajectoryParams {
  double least_evidence = 8.0;  // log of the odds a collision must raise the likelihood by
  int max_collisions = 24;
  // Says of the states of one piece that their motion cannot be told from tracking errors; empty:
  // the likelihood alone decides.
  std::function<bool(const std::vector<MotionState>&)> still;
};

// The motion of one object over a clip.
struct Trajectory {
  std::vector<MotionState> states;  // one per measurement
  std::vector<MotionPiece> pieces;
  std::vector<Collision> collisions;  // in order of time; empty: none found
  double noise_scale = 1.0;           // of the measurements, as found
  // Estimated over known gravity, the former with its deviation, where the object falls freely.
  struct Gravity {
    Eigen::Vector3d acceleration;  // m/s^2
    double deviation;              // m/s^2, of its length
    size_t frames = 0;             // of the fall that it was seen in
    size_t piece = 0;              // of the motion, that fall
  };
  std::optional<Gravity> gravity;

  // The piece that holds at `time`.
  const MotionPiece& pieceAt(double time) const;
  // False where the object is at rest within its uncertainty.
  bool movingAt(double time) const;
};

// Fits one trajectory to poses: pieces at rest, uniform, in free fall, steadily accelerated or
// forced, each kind chosen by the likelihood of the measurements, with collisions in between. The
// likelihood integrates over the unknown velocities, so that a piece more has to earn its place.
// @param cut_times  s; instants between frames at which the video was cut
// @throw std::invalid_argument when times do not increase, or nothing was measured
Trajectory fitTrajectory(const std::vector<PoseMeasurement>& measurements,
                         const std::vector<double>& cut_times, const MotionPrior& prior,
                         const TrajectoryParams& params = {});

}  // namespace calipso::flow
