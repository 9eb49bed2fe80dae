#include "calipso_flow/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "piece_fit.hpp"

namespace calipso::flow {
namespace {

using Measurements = std::vector<PoseMeasurement>;

constexpr double kFrameGrid[] = {0.125, 0.375, 0.625, 0.875};  // of a frame, first look
constexpr int kRefineRounds = 3;
constexpr size_t kLeastFrames = 2;  // in a piece: fewer tell nothing about its velocity

void checkTimes(const Measurements& measurements) {
  bool any = false;
  for (size_t k = 0; k < measurements.size(); ++k) {
    any = any || measurements[k].valid;
    if (k > 0 && !(measurements[k].time > measurements[k - 1].time)) {
      throw std::invalid_argument(
          "trajectory: measurement " + std::to_string(k) + " at " +
          std::to_string(measurements[k].time) + " s is not later than the one before (" +
          std::to_string(measurements[k - 1].time) + " s); give them in order of time");
    }
  }
  if (!any) throw std::invalid_argument("trajectory: no frame has a measured pose");
}

// A first look: how much a jump at `time` raises the likelihood of the frames around it, steady
// acceleration and spin being assumed on both sides.
double quickEvidence(const Measurements& around, double time, const MotionPrior& prior,
                     double noise_scale) {
  MotionPiece piece;
  piece.travel = Travel::kAccelerated;
  piece.turning = Turning::kSteady;
  piece.start = around.front().time;
  MotionPiece second = piece;
  second.start = time;
  return logLikelihood(around, {piece, second}, prior, noise_scale) -
         logLikelihood(around, {piece}, prior, noise_scale);
}

struct Candidate {
  double time = 0.0;
  double evidence = -std::numeric_limits<double>::infinity();
};

// The work on one trajectory; pieces are kept with their likelihoods, which only depend on their
// own frames.
class TrajectoryFitter {
 public:
  TrajectoryFitter(const Measurements& measurements, const MotionPrior& prior,
                   const TrajectoryParams& params)
      : measurements_(measurements), prior_(prior), params_(params) {}

  Trajectory run(const std::vector<double>& cut_times) {
    pieces_ = {MotionPiece{}};
    pieces_.front().start = measurements_.front().time;
    for (double time : cut_times) insertPiece(time, true);
    fitKindsAndNoise();
    for (int n = 0; n < params_.max_collisions && splitOnce(); ++n) fitKindsAndNoise();
    for (int round = 0; round < kRefineRounds; ++round) {
      refineTimes();
      fitKindsAndNoise();
    }
    return result();
  }

 private:
  Measurements measurementsOf(size_t piece) const {
    const double from = pieces_[piece].start;
    const double to = piece + 1 < pieces_.size() ? pieces_[piece + 1].start
                                                 : std::numeric_limits<double>::infinity();
    Measurements inside;
    for (const PoseMeasurement& m : measurements_) {
      if (m.time >= from && m.time < to) inside.push_back(m);
    }
    return inside;
  }

  void insertPiece(double time, bool cut) {
    MotionPiece piece;
    piece.start = time;
    piece.cut = cut;
    const auto place = std::upper_bound(
        pieces_.begin(), pieces_.end(), time,
        [](double t, const MotionPiece& p) { return t < p.start; });
    pieces_.insert(place, piece);
  }

  double likelihood() const {
    return logLikelihood(measurements_, pieces_, prior_, noise_scale_);
  }

  void fitKindsAndNoise() {
    for (size_t i = 0; i < pieces_.size(); ++i) chooseKind(measurements_, i, prior_, noise_scale_,
                                                           pieces_);
    noise_scale_ = chooseNoiseScale(measurements_, pieces_, prior_, noise_scale_);
  }

  // The most promising instant inside a piece.
  Candidate bestCandidate(size_t piece) const {
    const Measurements inside = measurementsOf(piece);
    Candidate best;
    for (size_t k = kLeastFrames - 1; k + kLeastFrames < inside.size(); ++k) {
      const size_t first = k + 1 > size_t(params_.window_frames) ? k + 1 - params_.window_frames : 0;
      const size_t end = std::min(inside.size(), k + 1 + params_.window_frames);
      const Measurements around(inside.begin() + first, inside.begin() + end);
      for (double share : kFrameGrid) {
        const double time = inside[k].time + share * (inside[k + 1].time - inside[k].time);
        if (isRejected(time)) continue;
        const double evidence = quickEvidence(around, time, prior_, noise_scale_);
        if (evidence > best.evidence) best = {time, evidence};
      }
    }
    return best;
  }

  bool isRejected(double time) const {
    const double near = 0.5 * frameSpacing();
    return std::any_of(rejected_.begin(), rejected_.end(),
                       [&](double t) { return std::abs(t - time) < near; });
  }

  double frameSpacing() const {
    const double span = measurements_.back().time - measurements_.front().time;
    return measurements_.size() > 1 ? span / (measurements_.size() - 1) : 1.0;
  }

  // Splits one piece where a collision explains the frames better than any single kind of motion.
  bool splitOnce() {
    for (;;) {
      Candidate best;
      for (size_t i = 0; i < pieces_.size(); ++i) {
        const Candidate candidate = bestCandidate(i);
        if (candidate.evidence > best.evidence) best = candidate;
      }
      if (best.evidence < params_.least_evidence) return false;
      if (trySplit(best.time)) return true;
      rejected_.push_back(best.time);
    }
  }

  bool trySplit(double time) {
    const std::vector<MotionPiece> saved = pieces_;
    const double before = likelihood();
    insertPiece(time, false);
    const size_t second = indexOfPieceAt(time);
    chooseKind(measurements_, second - 1, prior_, noise_scale_, pieces_);
    chooseKind(measurements_, second, prior_, noise_scale_, pieces_);
    pieces_[second].start = bestTime(second).time;
    if (likelihood() - before > params_.least_evidence) return true;
    pieces_ = saved;
    return false;
  }

  size_t indexOfPieceAt(double time) const {
    size_t i = 0;
    while (i + 1 < pieces_.size() && pieces_[i + 1].start <= time) ++i;
    return i;
  }

  // The likeliest start of a piece near the present one, and its log likelihood.
  Candidate bestTime(size_t piece) {
    const double original = pieces_[piece].start, step = frameSpacing();
    const Measurements before = measurementsOf(piece - 1), after = measurementsOf(piece);
    if (before.size() < kLeastFrames || after.size() < kLeastFrames) {
      return {original, likelihood()};
    }
    const double low = std::max(original - step, before[kLeastFrames - 1].time);
    const double high = std::min(original + step, after[after.size() - kLeastFrames].time);
    const auto score = [&](double time) {
      pieces_[piece].start = time;
      const double value = likelihood();
      pieces_[piece].start = original;
      return value;
    };
    const Maximum best = maximise(score, low, high, step);
    return {best.at, best.value};
  }

  void refineTimes() {
    for (size_t i = 1; i < pieces_.size(); ++i) {
      if (!pieces_[i].cut) pieces_[i].start = bestTime(i).time;
    }
  }

  // From the curvature of the log likelihood at its top.
  double timeDeviation(size_t piece) {
    const double step = 0.02 * frameSpacing(), at = pieces_[piece].start, top = likelihood();
    pieces_[piece].start = at - step;
    const double before = likelihood();
    pieces_[piece].start = at + step;
    const double after = likelihood();
    pieces_[piece].start = at;
    const double curvature = (2.0 * top - before - after) / (step * step);
    return curvature > 0.0 ? 1.0 / std::sqrt(curvature) : frameSpacing();
  }

  Trajectory result() {
    Trajectory trajectory;
    const SmoothedMotion motion = smooth(measurements_, pieces_, prior_, noise_scale_);
    trajectory.states = motion.states;
    trajectory.pieces = pieces_;
    trajectory.noise_scale = noise_scale_;
    for (const Jump& jump : motion.jumps) {
      if (jump.cut) continue;
      const size_t piece = indexOfPieceAt(jump.after.time);
      trajectory.collisions.push_back(
          {jump.after.time, timeDeviation(piece), jump.before, jump.after});
    }
    trajectory.gravity = fittedGravity(motion);
    return trajectory;
  }

  // The longest free fall tells most about gravity: fitted again with nothing known of it.
  std::optional<Trajectory::Gravity> fittedGravity(const SmoothedMotion&) const {
    size_t longest = 0, most = 0;
    for (size_t i = 0; i < pieces_.size(); ++i) {
      if (pieces_[i].travel != Travel::kFreeFall) continue;
      const size_t count = measurementsOf(i).size();
      if (count > most) longest = i, most = count;
    }
    if (most < 4) return std::nullopt;
    std::vector<MotionPiece> free = pieces_;
    free[longest].travel = Travel::kAccelerated;
    const SmoothedMotion motion = smooth(measurements_, free, prior_, noise_scale_);
    const double start = pieces_[longest].start;
    for (const MotionState& state : motion.states) {
      if (state.time < start) continue;
      const Eigen::Vector3d direction = state.acceleration.normalized();
      const double variance = direction.dot(state.covariance.block<3, 3>(6, 6) * direction);
      return Trajectory::Gravity{state.acceleration, std::sqrt(std::max(0.0, variance))};
    }
    return std::nullopt;
  }

  const Measurements& measurements_;
  const MotionPrior& prior_;
  const TrajectoryParams& params_;
  std::vector<MotionPiece> pieces_;
  std::vector<double> rejected_;
  double noise_scale_ = 1.0;
};

}  // namespace

double Collision::restitution() const {
  const Eigen::Vector3d normal = (after.velocity - before.velocity).normalized();
  return -after.velocity.dot(normal) / before.velocity.dot(normal);
}

const MotionPiece& Trajectory::pieceAt(double time) const {
  size_t i = 0;
  while (i + 1 < pieces.size() && pieces[i + 1].start <= time) ++i;
  return pieces[i];
}

bool Trajectory::movingAt(double time) const {
  const MotionPiece& piece = pieceAt(time);
  return piece.travel != Travel::kRest || piece.turning != Turning::kNone;
}

Trajectory fitTrajectory(const std::vector<PoseMeasurement>& measurements,
                         const std::vector<double>& cut_times, const MotionPrior& prior,
                         const TrajectoryParams& params) {
  checkTimes(measurements);
  return TrajectoryFitter(measurements, prior, params).run(cut_times);
}

}  // namespace calipso::flow
