#include "trajectory_fitter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_flow/rotation.hpp"
#include "piece_fit.hpp"

namespace calipso::flow {
namespace {

constexpr double kEver = std::numeric_limits<double>::infinity();
constexpr double kFrameGrid[] = {0.125, 0.375, 0.625, 0.875};  // of a frame, first look
constexpr int kRefineRounds = 3;
constexpr size_t kLeastFrames = 2;    // in a piece: fewer tell nothing about its velocity
constexpr size_t kTriedAtOnce = 8;    // candidates that are fitted fully before giving up
constexpr size_t kFramesAfter = 2;    // a first look goes no further: another collision may follow
constexpr int kSplitRounds = 2;       // kinds of motion and instant hang together
constexpr double kSplitReach = 0.4;   // frames by which a fit may move a candidate
constexpr double kRefineReach = 0.6;

struct FirstLook {
  double gain;    // of log likelihood, by a jump
  double misfit;  // log likelihood that is missing, even with the jump, against noise alone
};

// What a jump of velocity and spin at `time` does for the frames around it, the acceleration going
// on unchanged: an unknown one, or gravity, which a few frames cannot tell from a jump otherwise.
FirstLook lookFirst(const std::vector<PoseMeasurement>& around, double time,
                    const MotionPrior& prior, double noise_scale) {
  double with = -kEver, without = -kEver;
  for (const Travel travel : {Travel::kAccelerated, Travel::kFreeFall}) {
    if (travel == Travel::kFreeFall && prior.gravity.isZero()) continue;
    MotionPiece piece;
    piece.travel = travel;
    piece.turning = Turning::kSteady;
    piece.start = around.front().time;
    MotionPiece second = piece;
    second.start = time;
    second.same_acceleration = true;
    with = std::max(with, logLikelihood(around, {piece, second}, prior, noise_scale));
    without = std::max(without, logLikelihood(around, {piece}, prior, noise_scale));
  }
  double noise_alone = 0.0;
  for (const PoseMeasurement& m : around) {
    if (!m.valid) continue;
    const double log_determinant =
        m.covariance.ldlt().vectorD().array().log().sum() + 12.0 * std::log(noise_scale);
    noise_alone -= 0.5 * (log_determinant + 6.0 * std::log(2.0 * M_PI) + 6.0);
  }
  return {with - without, noise_alone - with};
}

}  // namespace

TrajectoryFitter::TrajectoryFitter(const std::vector<PoseMeasurement>& measurements,
                                   const MotionPrior& prior, const TrajectoryParams& params)
    : measurements_(measurements), prior_(prior), params_(params) {}

Trajectory TrajectoryFitter::run(const std::vector<double>& cut_times) {
  pieces_ = {MotionPiece{}};
  pieces_.front().start = measurements_.front().time;
  for (double time : cut_times) insertPiece(time, true);
  fitKindsAndNoise();
  for (int n = 0; n < params_.max_collisions && splitOnce(); ++n) fitKindsAndNoise();
  for (int round = 0; round < kRefineRounds; ++round) {
    refineTimes();
    fitKindsAndNoise();
  }
  dropUnearnedPieces();
  settleStillPieces();
  return result();
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

bool TrajectoryFitter::isRejected(double time) const {
  const double near = 0.5 * frameSpacing();
  return std::any_of(rejected_.begin(), rejected_.end(),
                     [&](double t) { return std::abs(t - time) < near; });
}

void TrajectoryFitter::insertPiece(double time, bool cut) {
  MotionPiece piece;
  piece.start = time;
  piece.cut = cut;
  const auto place =
      std::upper_bound(pieces_.begin(), pieces_.end(), time,
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

// The most promising instant between every two frames of a piece.
void TrajectoryFitter::addCandidates(size_t piece, std::vector<Candidate>& candidates) const {
  const Measurements inside = measurementsOf(piece, piece);
  const size_t window = params_.window_frames;
  for (size_t k = kLeastFrames - 1; k + kLeastFrames < inside.size(); ++k) {
    const size_t first = k + 1 > window ? k + 1 - window : 0;
    const size_t end = std::min(inside.size(), k + 1 + kFramesAfter);
    const Measurements around(inside.begin() + first, inside.begin() + end);
    Candidate best{0.0, kEver};
    for (double share : kFrameGrid) {
      const double time = inside[k].time + share * (inside[k + 1].time - inside[k].time);
      if (isRejected(time)) continue;
      const FirstLook look = lookFirst(around, time, prior_, noise_scale_);
      if (look.gain < params_.least_evidence) continue;
      if (look.misfit < best.misfit) best = {time, look.misfit};
    }
    if (best.misfit < kEver) candidates.push_back(best);
  }
}

// Takes the candidate whose surroundings are explained best, if it helps enough. The gain itself is
// no guide to the place: one wrong split can make up for two collisions badly.
bool TrajectoryFitter::splitOnce() {
  std::vector<Candidate> candidates;
  for (size_t i = 0; i < pieces_.size(); ++i) addCandidates(i, candidates);
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.misfit < b.misfit; });
  if (candidates.size() > kTriedAtOnce) candidates.resize(kTriedAtOnce);
  for (const Candidate& candidate : candidates) {
    std::vector<MotionPiece> split;
    if (splitAt(candidate.time, split) > params_.least_evidence) {
      pieces_ = split;
      return true;
    }
    rejected_.push_back(candidate.time);
  }
  return false;
}

// Splits at `time`, fits kinds and instant. @return the log likelihood gained
double TrajectoryFitter::splitAt(double time, std::vector<MotionPiece>& pieces) {
  const std::vector<MotionPiece> saved = pieces_;
  const double before = likelihood();
  insertPiece(time, false);
  const size_t second = indexOfPieceAt(time);
  for (int round = 0; round < kSplitRounds; ++round) {
    fitKind(second - 1);
    fitKind(second);
    pieces_[second].start = bestTime(second, kSplitReach * frameSpacing());
  }
  const double gain = likelihood() - before;
  pieces = pieces_;
  pieces_ = saved;
  return gain;
}

// A later piece may have taken over what an earlier one was needed for.
void TrajectoryFitter::dropUnearnedPieces() {
  for (size_t i = pieces_.size(); i-- > 1;) {
    if (pieces_[i].cut) continue;
    const std::vector<MotionPiece> saved = pieces_;
    const double with = likelihood();
    pieces_.erase(pieces_.begin() + i);
    fitKind(i - 1);
    if (with - likelihood() > params_.least_evidence) pieces_ = saved;
  }
}

void TrajectoryFitter::refineTimes() {
  for (size_t i = 1; i < pieces_.size(); ++i) {
    if (!pieces_[i].cut) pieces_[i].start = bestTime(i, kRefineReach * frameSpacing());
  }
}

// The likeliest start of a piece, within `reach` of the present one.
double TrajectoryFitter::bestTime(size_t piece, double reach) const {
  const double original = pieces_[piece].start, step = frameSpacing();
  const Measurements before = measurementsOf(piece - 1, piece - 1);
  const Measurements after = measurementsOf(piece, piece);
  if (before.size() < kLeastFrames || after.size() < kLeastFrames) return original;
  const double low = std::max(original - reach, before[kLeastFrames - 1].time);
  const double high = std::min(original + reach, after[after.size() - kLeastFrames].time);
  Neighbourhood local = neighbourhood(piece);
  return maximise(
             [&](double time) {
               local.pieces[local.index].start = time;
               return logLikelihood(local.measurements, local.pieces, prior_, noise_scale_);
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
    return logLikelihood(local.measurements, local.pieces, prior_, noise_scale_);
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

// The states, with the uncertainty of the twist that a resting object would show if it moved.
std::vector<MotionState> TrajectoryFitter::statesWithHonestRest(
    const SmoothedMotion& motion) const {
  std::vector<MotionPiece> drifting = pieces_;
  for (MotionPiece& piece : drifting) {
    if (piece.travel == Travel::kRest) piece.travel = Travel::kUniform;
    if (piece.turning == Turning::kNone) piece.turning = Turning::kSteady;
  }
  const SmoothedMotion free = smooth(measurements_, drifting, prior_, noise_scale_);
  std::vector<MotionState> states = motion.states;
  for (size_t k = 0; k < states.size(); ++k) {
    const MotionPiece& piece = pieces_[indexOfPieceAt(states[k].time)];
    const StateMatrix& drift = free.states[k].covariance;
    if (piece.travel == Travel::kRest) states[k].setVelocityCovariance(drift);
    if (piece.turning == Turning::kNone) states[k].setSpinCovariance(drift);
  }
  return states;
}

// Variance by which errors that persist from frame to frame exceed independent ones: for a lag-one
// correlation r of the residuals, (1 + r) / (1 - r). A fit of p numbers to n frames takes the slowest errors, those
// that persist most, into itself: what it leaves is correlated by about (p / n) (1 + r) less (fitted_share: p / n).
double TrajectoryFitter::persistence(const std::vector<MotionState>& states, double fitted_share) const {
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
  const double correlation = std::clamp((product / square + fitted_share) / (1.0 - fitted_share), 0.0, kLargest);
  return (1.0 + correlation) / (1.0 - correlation);
}

double TrajectoryFitter::pieceSpan(size_t piece) const {
  const Measurements inside = measurementsOf(piece, piece);
  return inside.size() < 2 ? frameSpacing() : inside.back().time - inside.front().time;
}

// Errors of deviation s at a piece's beginning and end make a velocity of sqrt(2) s / T. The mean over its poses, since the
// piece's velocity is that of all of them.
Matrix6d TrajectoryFitter::driftCovariance(double time) const {
  const size_t piece = indexOfPieceAt(time);
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
    const size_t count = measurementsOf(i, i).size();
    if (pieces_[i].travel == Travel::kFreeFall && count > most) longest = i, most = count;
  }
  if (most < kLeastFall) return std::nullopt;
  std::vector<MotionPiece> free = pieces_;
  free[longest].travel = Travel::kAccelerated;
  const SmoothedMotion motion = smooth(measurements_, free, prior_, noise_scale_);
  const auto state = std::find_if(motion.states.begin(), motion.states.end(), [&](const auto& s) {
    return indexOfPieceAt(s.time) == longest;
  });
  const Eigen::Vector3d direction = state->acceleration.normalized();
  const double variance = direction.dot(state->accelerationCovariance() * direction);
  return Trajectory::Gravity{state->acceleration, std::sqrt(std::max(0.0, variance)), most, longest};
}

Trajectory TrajectoryFitter::result() {
  Trajectory trajectory;
  const SmoothedMotion motion = smooth(measurements_, pieces_, prior_, noise_scale_);
  trajectory.states = statesWithHonestRest(motion);
  const double share = std::min(0.5, 2.0 * pieces_.size() / static_cast<double>(measurements_.size()));
  const double factor = persistence(motion.states, share);
  for (MotionState& state : trajectory.states) {
    state.covariance *= factor;
    state.addTwistCovariance(driftCovariance(state.time));
  }
  trajectory.pieces = pieces_;
  trajectory.noise_scale = noise_scale_;
  trajectory.gravity = fittedGravity();
  if (trajectory.gravity) {
    const size_t frames = trajectory.gravity->frames;
    const double share = std::min(0.5, 2.0 / static_cast<double>(frames));  // a parabola's; where it starts is given
    // A bend of the poses by s over the time T of the fall is an acceleration of 8 s / T^2.
    const double span = pieceSpan(trajectory.gravity->piece);
    const Eigen::Vector3d along = trajectory.gravity->acceleration.normalized();
    const double drift = along.dot(driftCovariance(measurementsOf(trajectory.gravity->piece, trajectory.gravity->piece).front().time).topLeftCorner<3, 3>() * along);
    trajectory.gravity->deviation = std::sqrt(std::pow(trajectory.gravity->deviation, 2) * persistence(motion.states, share) +
                                              32.0 * drift / (span * span));
  }
  for (const Jump& jump : motion.jumps) {
    if (jump.cut) continue;
    const double time = jump.after.time;
    trajectory.collisions.push_back(
        {time, timeDeviation(indexOfPieceAt(time)), jump.before, jump.after});
  }
  return trajectory;
}

}  // namespace calipso::flow
