#include "trajectory_fitter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_flow/rotation.hpp"
#include "piece_fit.hpp"
#include "piece_path.hpp"

namespace calipso::flow {
namespace {

constexpr double kEver = std::numeric_limits<double>::infinity();
constexpr int kRefineRounds = 3;
constexpr double kRefineReach = 0.6;  // frames by which a fit may move an instant

}  // namespace

TrajectoryFitter::TrajectoryFitter(const std::vector<PoseMeasurement>& measurements,
                                   const MotionPrior& prior, const TrajectoryParams& params)
    : measurements_(measurements), prior_(prior), params_(params) {}

Trajectory TrajectoryFitter::run(const std::vector<double>& cut_times) {
  noise_scale_ = noiseScaleBetweenJumps(measurements_);
  divide(cut_times);
  fitKindsAndNoise();
  for (int round = 0; round < kRefineRounds; ++round) {
    refineTimes();
    chooseContacts();
    fitKindsAndNoise();
  }
  dropUnearnedPieces();
  dropJumpsOfSpinAlone();
  settleStillPieces();
  dropExcursions();
  letFallingPiecesTurn();
  return result();
}

// By collisions, no more than are allowed, and cuts.
void TrajectoryFitter::divide(const std::vector<double>& cut_times) {
  if (params_.max_collisions > 0) {
    for (double evidence = params_.least_evidence;; evidence = std::max(1.0, 2.0 * evidence)) {
      pieces_ = likeliestPieces(measurements_, cut_times, prior_, noise_scale_, evidence);
      if (pieces_.size() <= 1 + cut_times.size() + params_.max_collisions) return;
    }
  }
  pieces_ = {MotionPiece{}};
  pieces_.front().start = measurements_.front().time;
  for (double time : cut_times) insertPiece(time, true);
}

double TrajectoryFitter::frameSpacing() const {
  const double span = measurements_.back().time - measurements_.front().time;
  return measurements_.size() > 1 ? span / (measurements_.size() - 1) : 1.0;
}

double TrajectoryFitter::likelihood() const {
  return logLikelihood(measurements_, pieces_, prior_, noise_scale_);
}

size_t TrajectoryFitter::indexOfPieceAt(double time) const {
  size_t i = 0;
  while (i + 1 < pieces_.size() && pieces_[i + 1].start <= time) ++i;
  return i;
}

TrajectoryFitter::Measurements TrajectoryFitter::measurementsOf(size_t first_piece,
                                                                size_t last_piece) const {
  const double from = pieces_[first_piece].start;
  const double to = last_piece + 1 < pieces_.size() ? pieces_[last_piece + 1].start : kEver;
  Measurements inside;
  for (const PoseMeasurement& m : measurements_) {
    if (m.time >= from && m.time < to) inside.push_back(m);
  }
  return inside;
}

TrajectoryFitter::Neighbourhood TrajectoryFitter::neighbourhood(size_t piece) const {
  const size_t first = piece > 0 ? piece - 1 : 0;
  const size_t last = std::min(piece + 1, pieces_.size() - 1);
  Neighbourhood local;
  local.measurements = measurementsOf(first, last);
  local.pieces.assign(pieces_.begin() + first, pieces_.begin() + last + 1);
  local.index = piece - first;
  return local;
}

void TrajectoryFitter::insertPiece(double time, bool cut) {
  MotionPiece piece;
  piece.start = time;
  piece.cut = cut;
  const auto place = std::upper_bound(pieces_.begin(), pieces_.end(), time,
                                      [](double t, const MotionPiece& p) { return t < p.start; });
  pieces_.insert(place, piece);
}

void TrajectoryFitter::fitKind(size_t piece) {
  Neighbourhood local = neighbourhood(piece);
  if (local.measurements.empty()) return;
  chooseKind(local.measurements, local.index, prior_, noise_scale_, local.pieces);
  pieces_[piece] = local.pieces[local.index];
}

void TrajectoryFitter::fitKindsAndNoise() {
  for (size_t i = 0; i < pieces_.size(); ++i) fitKind(i);
  noise_scale_ = chooseNoiseScale(measurements_, pieces_, prior_, noise_scale_);
}

void TrajectoryFitter::refineTimes() {
  for (size_t i = 1; i < pieces_.size(); ++i) {
    if (!pieces_[i].cut) pieces_[i].start = bestTime(i, kRefineReach * frameSpacing());
  }
}

// One impact, or several within a part of a frame: whichever is likelier at its own best instant.
void TrajectoryFitter::chooseContacts() {
  for (size_t i = 1; i < pieces_.size(); ++i) {
    if (pieces_[i].cut) continue;
    MotionPiece best = pieces_[i];
    double most = -kEver;
    for (const double share : {0.0, kContactShare}) {
      pieces_[i].contact = share * frameSpacing();
      pieces_[i].start = bestTime(i, kRefineReach * frameSpacing());
      const Neighbourhood local = neighbourhood(i);
      const double value = logLikelihood(local.measurements, local.pieces, prior_, noise_scale_) +
                           contactOdds(i, pieces_[i].start) -
                           (share > 0.0 ? kContactEvidence : 0.0);
      if (value > most) most = value, best = pieces_[i];
    }
    pieces_[i] = best;
  }
}

size_t TrajectoryFitter::leastFramesOf(size_t piece) const {
  const bool first = piece == 0 || pieces_[piece].cut;
  const bool last = piece + 1 == pieces_.size() || pieces_[piece + 1].cut;
  return leastFrames(first, last);
}

// Log odds, besides those of the poses, of a piece that starts at `time`: what falls on a support
// most likely strikes it where it reaches it. One or two poses after it cannot tell the instant: an
// impact shortly before them with a fast rebound fits as well as an earlier one with a slow one.
double TrajectoryFitter::contactOdds(size_t piece, double time) const {
  constexpr std::ptrdiff_t kFewPoses = 2;
  constexpr double kTrust = 100.0;  // odds that it strikes there and at no other instant
  const auto next = std::find_if(measurements_.begin(), measurements_.end(),
                                 [&](const PoseMeasurement& m) { return m.time >= time; });
  if (next == measurements_.end() || !next->contact) return 0.0;
  const double end = piece + 1 < pieces_.size() ? pieces_[piece + 1].start : kEver;
  const auto shows = [end](const PoseMeasurement& m) { return m.valid && m.time < end; };
  if (std::count_if(next, measurements_.end(), shows) > kFewPoses) return 0.0;
  const auto began = next - 2;  // the fall from there has no jump in it
  if (piece > 1 && pieces_[piece - 1].start > began->time) return 0.0;
  const double off = (time - next->contact->time) / next->contact->deviation;
  const double density =
      std::exp(-0.5 * off * off) / (std::sqrt(2.0 * M_PI) * next->contact->deviation);
  return std::log1p(kTrust * density * (next->time - (next - 1)->time));
}

// The likeliest start of a piece, within `reach` of the present one.
double TrajectoryFitter::bestTime(size_t piece, double reach) const {
  const double original = pieces_[piece].start, step = frameSpacing();
  const Measurements before = measurementsOf(piece - 1, piece - 1);
  const Measurements after = measurementsOf(piece, piece);
  const size_t least_before = leastFramesOf(piece - 1), least_after = leastFramesOf(piece);
  if (before.size() < least_before || after.size() < least_after) return original;
  const double low = std::max(original - reach, before[least_before - 1].time);
  const double high = std::min(original + reach, after[after.size() - least_after].time);
  Neighbourhood local = neighbourhood(piece);
  return maximise(
             [&](double time) {
               local.pieces[local.index].start = time;
               return logLikelihood(local.measurements, local.pieces, prior_, noise_scale_) +
                      contactOdds(piece, time);
             },
             low, high, step)
      .at;
}

// From the curvature of the log likelihood at its top.
double TrajectoryFitter::timeDeviation(size_t piece) const {
  Neighbourhood local = neighbourhood(piece);
  const double step = 0.02 * frameSpacing(), at = pieces_[piece].start;
  const auto score = [&](double time) {
    local.pieces[local.index].start = time;
    return logLikelihood(local.measurements, local.pieces, prior_, noise_scale_) +
           contactOdds(piece, time);
  };
  const double curvature = (2.0 * score(at) - score(at - step) - score(at + step)) / (step * step);
  return curvature > 0.0 ? std::min(frameSpacing(), 1.0 / std::sqrt(curvature)) : frameSpacing();
}

// Pieces in which nothing measurable happens are at rest: tracks err together by about as much.
void TrajectoryFitter::settleStillPieces() {
  if (!params_.still) return;
  const SmoothedMotion motion = smooth(measurements_, pieces_, prior_, noise_scale_);
  for (size_t i = 0; i < pieces_.size(); ++i) {
    std::vector<MotionState> inside;
    for (const MotionState& state : motion.states) {
      if (indexOfPieceAt(state.time) == i) inside.push_back(state);
    }
    if (inside.empty() || !params_.still(inside)) continue;
    pieces_[i].travel = Travel::kRest;
    pieces_[i].turning = Turning::kNone;
  }
}

// Nothing keeps from turning what falls. That no spin stands out is no reason to know it for none:
// the velocity, which hangs together with it in the poses' errors, would be off and its interval
// too narrow. The pieces are told apart before, while every travel is free not to turn.
void TrajectoryFitter::letFallingPiecesTurn() {
  for (MotionPiece& piece : pieces_) {
    if (piece.travel == Travel::kFreeFall && piece.turning == Turning::kNone)
      piece.turning = Turning::kSteady;
  }
}

// With the uncertainty of the twist that a resting object would show if it moved.
SmoothedMotion TrajectoryFitter::withHonestRest(SmoothedMotion motion) const {
  std::vector<MotionPiece> drifting = pieces_;
  for (MotionPiece& piece : drifting) {
    if (piece.travel == Travel::kRest) piece.travel = Travel::kUniform;
    if (piece.turning == Turning::kNone) piece.turning = Turning::kSteady;
  }
  const SmoothedMotion free = smooth(measurements_, drifting, prior_, noise_scale_);
  const auto take = [&](const MotionState& drift, size_t piece, MotionState& state) {
    if (pieces_[piece].travel == Travel::kRest) state.setVelocityCovariance(drift.covariance);
    if (pieces_[piece].turning == Turning::kNone) state.setSpinCovariance(drift.covariance);
  };
  for (size_t k = 0; k < motion.states.size(); ++k)
    take(free.states[k], indexOfPieceAt(motion.states[k].time), motion.states[k]);
  for (size_t k = 0; k < motion.jumps.size(); ++k) {
    const size_t after = indexOfPieceAt(motion.jumps[k].after.time);
    take(free.jumps[k].before, after - 1, motion.jumps[k].before);
    take(free.jumps[k].after, after, motion.jumps[k].after);
  }
  return motion;
}

// Variance by which errors that persist from frame to frame exceed independent ones: for a lag-one
// correlation r of the residuals, (1 + r) / (1 - r). A fit of p numbers to n frames takes the
// slowest errors, those that persist most, into itself: what it leaves is correlated by about (p /
// n) (1 + r) less (fitted_share: p / n).
double TrajectoryFitter::persistence(const std::vector<MotionState>& states,
                                     double fitted_share) const {
  constexpr double kLargest = 0.9;
  double product = 0.0, square = 0.0;
  Vector6d previous = Vector6d::Zero();
  bool has_previous = false;
  for (size_t k = 1; k < states.size(); ++k) {  // the first pose is given, not measured
    const PoseMeasurement& m = measurements_[k];
    const bool continued = has_previous;
    has_previous = m.valid;
    if (!m.valid) continue;
    Vector6d residual;
    residual << m.position - states[k].position,
        vectorFromRotation(m.rotation * states[k].rotation.transpose());
    const Vector6d whitened = m.covariance.llt().matrixL().solve(residual);
    square += whitened.squaredNorm();
    if (continued) product += whitened.dot(previous);
    previous = whitened;
  }
  if (square == 0.0) return 1.0;
  const double correlation =
      std::clamp((product / square + fitted_share) / (1.0 - fitted_share), 0.0, kLargest);
  return (1.0 + correlation) / (1.0 - correlation);
}

double TrajectoryFitter::pieceSpan(size_t piece) const {
  const Measurements inside = measurementsOf(piece, piece);
  return inside.size() < 2 ? frameSpacing() : inside.back().time - inside.front().time;
}

// Errors of deviation s at a piece's beginning and end make a velocity of sqrt(2) s / T. The mean
// over its poses, since the piece's velocity is that of all of them.
Matrix6d TrajectoryFitter::driftCovariance(size_t piece) const {
  const Measurements inside = measurementsOf(piece, piece);
  Matrix6d sum = Matrix6d::Zero();
  for (const PoseMeasurement& m : inside) sum += m.common / inside.size();
  return 2.0 * sum / std::pow(pieceSpan(piece), 2);
}

// The longest free fall tells most about gravity: fitted again with nothing known of it.
std::optional<Trajectory::Gravity> TrajectoryFitter::fittedGravity() const {
  constexpr size_t kLeastFall = 4;  // frames
  size_t longest = 0, most = 0;
  for (size_t i = 0; i < pieces_.size(); ++i) {
    const Measurements inside = measurementsOf(i, i);
    const size_t count = std::count_if(inside.begin(), inside.end(),
                                       [](const PoseMeasurement& m) { return m.valid; });
    if (pieces_[i].travel == Travel::kFreeFall && count > most) longest = i, most = count;
  }
  if (most < kLeastFall) return std::nullopt;
  std::vector<MotionPiece> free = pieces_;
  free[longest].travel = Travel::kAccelerated;
  const SmoothedMotion motion = smooth(measurements_, free, prior_, noise_scale_);
  const auto state = std::find_if(motion.states.begin(), motion.states.end(),
                                  [&](const auto& s) { return indexOfPieceAt(s.time) == longest; });
  const Eigen::Vector3d direction = state->acceleration.normalized();
  const double variance = direction.dot(state->accelerationCovariance() * direction);
  return Trajectory::Gravity{state->acceleration, std::sqrt(std::max(0.0, variance)), most,
                             longest};
}

// What slides or sways to a rest is brought to it by forces that are no larger than its weight.
bool TrajectoryFitter::isImpact(const Jump& jump) const {
  if (jump.cut) return false;
  const auto rests = [&](size_t piece) { return pieces_[piece].travel == Travel::kRest; };
  const size_t after = indexOfPieceAt(jump.after.time);
  if (!rests(after) && !rests(after - 1)) return true;
  return (jump.after.velocity - jump.before.velocity).norm() >
         prior_.gravity.norm() * frameSpacing();
}

// The states' errors persist by `factor`, and drift.
void TrajectoryFitter::widen(MotionState& state, size_t piece, double factor) const {
  state.covariance *= factor;
  state.addTwistCovariance(driftCovariance(piece));
}

void TrajectoryFitter::widen(Trajectory::Gravity& gravity,
                             const std::vector<MotionState>& states) const {
  // A parabola's two numbers; where it starts is given.
  const double share = std::min(0.5, 2.0 / static_cast<double>(gravity.frames));
  // A bend of the poses by s over the time T of the fall is an acceleration of 8 s / T^2.
  const double span = pieceSpan(gravity.piece);
  const Eigen::Vector3d along = gravity.acceleration.normalized();
  const double drift = along.dot(driftCovariance(gravity.piece).topLeftCorner<3, 3>() * along);
  gravity.deviation = std::sqrt(std::pow(gravity.deviation, 2) * persistence(states, share) +
                                32.0 * drift / (span * span));
}

Trajectory TrajectoryFitter::result() {
  Trajectory trajectory;
  const SmoothedMotion motion =
      withHonestRest(smooth(measurements_, pieces_, prior_, noise_scale_));
  trajectory.states = motion.states;
  const double share =
      std::min(0.5, 2.0 * pieces_.size() / static_cast<double>(measurements_.size()));
  const double factor = persistence(motion.states, share);
  for (MotionState& state : trajectory.states) widen(state, indexOfPieceAt(state.time), factor);
  trajectory.pieces = pieces_;
  trajectory.noise_scale = noise_scale_;
  trajectory.gravity = fittedGravity();
  if (trajectory.gravity) widen(*trajectory.gravity, motion.states);
  for (const Jump& jump : motion.jumps) {
    if (!isImpact(jump)) continue;
    const size_t after = indexOfPieceAt(jump.after.time);
    Collision impact{jump.after.time, timeDeviation(after), jump.before, jump.after};
    widen(impact.before, after - 1, factor);
    widen(impact.after, after, factor);
    trajectory.collisions.push_back(impact);
  }
  return trajectory;
}

}  // namespace calipso::flow
