#include "piece_path.hpp"

#include <algorithm>
#include <limits>
#include <optional>

namespace calipso::flow {
namespace {

constexpr double kNever = -std::numeric_limits<double>::infinity();
constexpr double kInstants[] = {0.125, 0.375, 0.625, 0.875};  // of a frame
constexpr double kHopeless = 60.0;  // log odds by which a path lies behind that never catches up

// The kinds that are told apart here; a finer choice comes after. Shares are of the prior's
// deviations.
std::vector<MotionPiece> plainKinds(const MotionPrior& prior) {
  const auto kind = [&](Travel travel, Turning turning, double jerk_share, double spin_share) {
    MotionPiece piece;
    piece.travel = travel;
    piece.turning = turning;
    piece.jerk = jerk_share * prior.acceleration;
    piece.spin_noise = spin_share * prior.spin;
    return piece;
  };
  std::vector<MotionPiece> kinds{kind(Travel::kRest, Turning::kNone, 0.0, 0.0),
                                 kind(Travel::kUniform, Turning::kSteady, 0.0, 0.0),
                                 kind(Travel::kForced, Turning::kForced, 0.01, 0.03),
                                 kind(Travel::kForced, Turning::kForced, 0.1, 0.3)};
  if (!prior.gravity.isZero()) {
    kinds.push_back(kind(Travel::kFreeFall, Turning::kSteady, 0.0, 0.0));
    kinds.push_back(kind(Travel::kFreeFall, Turning::kForced, 0.0, 0.01));
  }
  return kinds;
}

// The best way to explain the frames up to one: its last piece and where that began.
struct Stage {
  double log_likelihood = kNever;
  MotionState state;
  MotionPiece piece;
  int before = -1;  // stage that the last piece follows
};

class PathSearch {
 public:
  PathSearch(const std::vector<PoseMeasurement>& measurements, const std::vector<double>& cut_times,
             const MotionPrior& prior, double noise_scale, double least_evidence)
      : measurements_(measurements),
        cut_times_(cut_times),
        prior_(prior),
        noise_scale_(noise_scale),
        least_evidence_(least_evidence),
        kinds_(plainKinds(prior)),
        stages_(measurements.size()) {}

  std::vector<MotionPiece> run() {
    const double begin = measurements_.front().time;
    for (MotionPiece piece : kinds_) {
      piece.start = begin;
      follow(-1, initialState(begin, piece, prior_, measurements_.front()), piece, 0.0);
    }
    for (int s = 0; s + 1 < static_cast<int>(stages_.size()); ++s) {
      if (stages_[s].log_likelihood > kNever) branch(s);
    }
    std::vector<MotionPiece> pieces;
    for (int k = static_cast<int>(stages_.size()) - 1; k >= 0; k = stages_[k].before) {
      pieces.push_back(stages_[k].piece);
    }
    std::reverse(pieces.begin(), pieces.end());
    return pieces;
  }

 private:
  std::optional<double> cutAfter(int frame) const {
    for (const double time : cut_times_) {
      if (time > measurements_[frame].time && time <= measurements_[frame + 1].time) return time;
    }
    return std::nullopt;
  }

  // All pieces that may follow a stage.
  void branch(int s) {
    const double from = measurements_[s].time, span = measurements_[s + 1].time - from;
    std::vector<double> instants;
    const std::optional<double> cut = cutAfter(s);
    if (cut)
      instants = {*cut};
    else
      for (const double share : kInstants) instants.push_back(from + share * span);
    const double evidence = evidenceBefore(measurements_[s + 1], least_evidence_);
    for (const double time : instants) {
      const MotionState arrived = predicted(stages_[s].state, time, stages_[s].piece);
      for (MotionPiece piece : kinds_) {
        piece.start = time;
        piece.cut = cut.has_value();
        follow(s, enterPiece(arrived, piece, prior_), piece,
               stages_[s].log_likelihood - (cut ? 0.0 : evidence));
        if (cut || piece.travel == Travel::kRest) continue;
        piece.contact = kContactShare * span;
        follow(s, enterPiece(arrived, piece, prior_), piece,
               stages_[s].log_likelihood - evidence - kContactEvidence);
      }
    }
  }

  // Carries a piece on through the frames after a stage, and notes where it is the best.
  void follow(int s, MotionState state, const MotionPiece& piece, double log_likelihood) {
    int frames = 0;
    const int count = static_cast<int>(stages_.size());
    for (int k = s + 1; k < count; ++k) {
      state = predicted(state, measurements_[k], piece, noise_scale_);
      if (measurements_[k].valid)
        log_likelihood +=
            correct(state, measurements_[k], noise_scale_) + oddsOf(measurements_[k], piece);
      ++frames;
      Stage& stage = stages_[k];
      const bool ends = k + 1 == count || cutAfter(k).has_value();
      const bool begins = s < 0 || piece.cut;
      const bool all = begins && ends;  // that there is between two cuts
      if ((frames >= leastFrames(begins, ends) || all) && log_likelihood > stage.log_likelihood) {
        stage = {log_likelihood, state, piece, s};
      }
      if (ends || log_likelihood < stage.log_likelihood - kHopeless) return;
    }
  }

  const std::vector<PoseMeasurement>& measurements_;
  const std::vector<double>& cut_times_;
  const MotionPrior& prior_;
  const double noise_scale_, least_evidence_;
  const std::vector<MotionPiece> kinds_;
  std::vector<Stage> stages_;  // per frame
};

}  // namespace

std::vector<MotionPiece> likeliestPieces(const std::vector<PoseMeasurement>& measurements,
                                         const std::vector<double>& cut_times,
                                         const MotionPrior& prior, double noise_scale,
                                         double least_evidence) {
  return PathSearch(measurements, cut_times, prior, noise_scale, least_evidence).run();
}

}  // namespace calipso::flow
