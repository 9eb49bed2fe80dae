// What TrajectoryFitter takes away again from the pieces that it has found.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "piece_fit.hpp"
#include "piece_path.hpp"
#include "trajectory_fitter.hpp"

namespace calipso::flow {
namespace {

constexpr double kDropReach =
    1.2;  // frames by which an instant may move when its neighbour is gone

}  // namespace

// Log odds that the collision at a piece's start must have. What lies below pushes up or aside: a
// push down is more likely an error of the poses.
double TrajectoryFitter::evidenceFor(size_t piece) const {
  constexpr double kPushedDown = 16.0, kDownwards = 0.3;  // log odds; cosine
  const double time = pieces_[piece].start;
  const SmoothedMotion motion = smooth(measurements_, pieces_, prior_, noise_scale_);
  const auto jump = std::find_if(motion.jumps.begin(), motion.jumps.end(),
                                 [&](const Jump& j) { return j.after.time >= time; });
  if (jump != motion.jumps.end()) {
    const Eigen::Vector3d change = jump->after.velocity - jump->before.velocity;
    if (change.dot(prior_.gravity) > kDownwards * change.norm() * prior_.gravity.norm())
      return params_.least_evidence + kPushedDown;
  }
  const auto next = std::find_if(measurements_.begin(), measurements_.end(),
                                 [&](const PoseMeasurement& m) { return m.time >= time; });
  return next == measurements_.end() ? params_.least_evidence
                                     : evidenceBefore(*next, params_.least_evidence);
}

// A later piece may have taken over what an earlier one was needed for.
void TrajectoryFitter::dropUnearnedPieces() {
  for (size_t i = pieces_.size(); i-- > 1;) {
    if (pieces_[i].cut) continue;
    const std::vector<MotionPiece> saved = pieces_;
    const double with = likelihood(), evidence = evidenceFor(i);
    pieces_.erase(pieces_.begin() + i);
    fitKind(i - 1);
    // Two instants in a row may stand for one in between.
    for (const size_t near : {i - 1, i}) {
      if (near == 0 || near >= pieces_.size() || pieces_[near].cut) continue;
      pieces_[near].start = bestTime(near, kDropReach * frameSpacing());
      fitKind(near - 1);
      fitKind(near);
    }
    if (with - likelihood() > evidence) pieces_ = saved;
  }
}

// An impulse at a point of contact changes the velocity; where that goes on, a change of spin is an
// error of the tracks. The least certain jump goes first: without it the others look different.
void TrajectoryFitter::dropJumpsOfSpinAlone() {
  constexpr double kSurprise = 16.27;  // chi-squared with 3 degrees of freedom, 99.9 %
  while (true) {
    const SmoothedMotion motion = smooth(measurements_, pieces_, prior_, noise_scale_);
    double least = kSurprise;
    double time = 0.0;
    for (const Jump& jump : motion.jumps) {
      if (jump.cut) continue;
      const Eigen::Vector3d change = jump.after.velocity - jump.before.velocity;
      const Eigen::Matrix3d covariance = jump.before.twistCovariance().topLeftCorner<3, 3>() +
                                         jump.after.twistCovariance().topLeftCorner<3, 3>();
      const double surprise = change.dot(covariance.ldlt().solve(change));
      if (surprise < least) least = surprise, time = jump.after.time;
    }
    if (least == kSurprise) return;
    const size_t piece = indexOfPieceAt(time);
    pieces_.erase(pieces_.begin() + piece);
    fitKind(piece - 1);
  }
}

// What rests, is elsewhere for a few poses and rests again where it was has not moved: these poses
// are wrong. Nor has what rests again a pose or two, and 0.13 s, later, wherever: no force starts and
// stops things so fast, but what is mostly hidden is easily found again in another place.
void TrajectoryFitter::dropExcursions() {
  const auto rests = [&](size_t i) { return pieces_[i].travel == Travel::kRest; };
  for (size_t first = 1; first < pieces_.size(); ++first) {
    if (!rests(first - 1)) continue;
    size_t back = first;
    while (back < pieces_.size() && !rests(back)) ++back;
    if (back == first || back == pieces_.size() || !isExcursion(first, back)) continue;
    pieces_.erase(pieces_.begin() + first, pieces_.begin() + back + 1);
    --first;
  }
}

// @param first, back  pieces: the first that moves, and the one that rests again
bool TrajectoryFitter::isExcursion(size_t first, size_t back) const {
  constexpr size_t kMostPoses = 4, kNoMotion = 2;
  constexpr double kMostTime = 0.21, kNoMotionTime = 0.13;  // s: as many poses at 24 frames/s
  constexpr double kBack = 0.5;  // of the way out: so near it is where it was
  const auto is_cut = [](const MotionPiece& piece) { return piece.cut; };
  const Measurements before = measurementsOf(first - 1, first - 1),
                     away = measurementsOf(first, back - 1), after = measurementsOf(back, back);
  if (before.empty() || after.empty()) return false;
  const double between = after.front().time - before.back().time;
  if (away.size() > kMostPoses || between > kMostTime ||
      std::any_of(pieces_.begin() + first, pieces_.begin() + back + 1, is_cut))
    return false;
  if (away.size() <= kNoMotion && between < kNoMotionTime) return true;
  const SmoothedMotion motion = smooth(measurements_, pieces_, prior_, noise_scale_);
  const auto positionAt = [&](double time) {
    const auto state = std::find_if(motion.states.begin(), motion.states.end(),
                                    [&](const MotionState& s) { return s.time >= time; });
    return state->position;
  };
  const Eigen::Vector3d place = positionAt(before.back().time);
  double out = 0.0;
  for (const PoseMeasurement& m : away)
    if (m.valid) out = std::max(out, (m.position - place).norm());
  return (positionAt(after.front().time) - place).norm() < kBack * out;
}

}  // namespace calipso::flow
