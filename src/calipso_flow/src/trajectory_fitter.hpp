#pragma once

#include <optional>
#include <vector>

#include "calipso_flow/trajectory.hpp"

namespace calipso::flow {

// The work on one trajectory: pieces are split where a collision explains the frames better than
// any single kind of motion, and their kinds, the instants and the noise are fitted in turn.
class TrajectoryFitter {
 public:
  TrajectoryFitter(const std::vector<PoseMeasurement>& measurements, const MotionPrior& prior,
                   const TrajectoryParams& params);

  Trajectory run(const std::vector<double>& cut_times);

 private:
  using Measurements = std::vector<PoseMeasurement>;
  struct Candidate {
    double time;    // s
    double misfit;  // how much less likely the frames around are, even with a jump, than noise alone
  };
  // A piece with its neighbours and their frames: all that its fit depends on.
  struct Neighbourhood {
    Measurements measurements;
    std::vector<MotionPiece> pieces;
    size_t index;  // of the piece in `pieces`
  };

  double frameSpacing() const;
  double likelihood() const;
  size_t indexOfPieceAt(double time) const;
  Measurements measurementsOf(size_t first_piece, size_t last_piece) const;
  Neighbourhood neighbourhood(size_t piece) const;
  bool isRejected(double time) const;

  void insertPiece(double time, bool cut);
  void fitKind(size_t piece);
  void fitKindsAndNoise();
  void addCandidates(size_t piece, std::vector<Candidate>& candidates) const;
  bool splitOnce();
  double splitAt(double time, std::vector<MotionPiece>& pieces);
  void dropUnearnedPieces();
  void refineTimes();
  double bestTime(size_t piece, double reach) const;
  double timeDeviation(size_t piece) const;

  void settleStillPieces();
  std::vector<MotionState> statesWithHonestRest(const SmoothedMotion& motion) const;
  // Of velocity and spin, by errors of the poses that change slowly over the piece at `time`.
  Matrix6d driftCovariance(double time) const;
  double pieceSpan(size_t piece) const;  // s, from its first measurement to its last
  double persistence(const std::vector<MotionState>& states, double fitted_share) const;
  std::optional<Trajectory::Gravity> fittedGravity() const;
  Trajectory result();

  const Measurements& measurements_;
  const MotionPrior& prior_;
  const TrajectoryParams& params_;
  std::vector<MotionPiece> pieces_;
  std::vector<double> rejected_;  // s; instants at which a split was tried and did not pay
  double noise_scale_ = 1.0;
};

}  // namespace calipso::flow
