#pragma once

#include <optional>
#include <vector>

#include "calipso_flow/trajectory.hpp"

namespace calipso::flow {

// The work on one trajectory: the motion is divided into pieces, and their kinds, the instants and
// the noise are fitted in turn.
class TrajectoryFitter {
 public:
  TrajectoryFitter(const std::vector<PoseMeasurement>& measurements, const MotionPrior& prior,
                   const TrajectoryParams& params);

  Trajectory run(const std::vector<double>& cut_times);

 private:
  using Measurements = std::vector<PoseMeasurement>;
  // A piece with its neighbours and their frames: all that its fit depends on.
  struct Neighbourhood {
    Measurements measurements;
    std::vector<MotionPiece> pieces;
    size_t index;  // of the piece in `pieces`
  };

  void divide(const std::vector<double>& cut_times);
  double frameSpacing() const;
  double likelihood() const;
  size_t indexOfPieceAt(double time) const;
  Measurements measurementsOf(size_t first_piece, size_t last_piece) const;
  Neighbourhood neighbourhood(size_t piece) const;

  void insertPiece(double time, bool cut);
  void fitKind(size_t piece);
  void fitKindsAndNoise();
  double evidenceFor(size_t piece) const;
  void dropUnearnedPieces();
  void dropJumpsOfSpinAlone();
  void dropExcursions();
  bool isExcursion(size_t first, size_t back) const;
  void refineTimes();
  void chooseContacts();
  size_t leastFramesOf(size_t piece) const;
  double bestTime(size_t piece, double reach) const;
  double contactOdds(size_t piece, double time) const;
  double timeDeviation(size_t piece) const;

  void settleStillPieces();
  void letFallingPiecesTurn();
  bool isImpact(const Jump& jump) const;
  SmoothedMotion withHonestRest(SmoothedMotion motion) const;
  // Of velocity and spin, by errors of the poses that change slowly over the piece.
  Matrix6d driftCovariance(size_t piece) const;
  void widen(MotionState& state, size_t piece, double factor) const;
  void widen(Trajectory::Gravity& gravity, const std::vector<MotionState>& states) const;
  double pieceSpan(size_t piece) const;  // s, from its first measurement to its last
  double persistence(const std::vector<MotionState>& states, double fitted_share) const;
  std::optional<Trajectory::Gravity> fittedGravity() const;
  Trajectory result();

  const Measurements& measurements_;
  const MotionPrior& prior_;
  const TrajectoryParams& params_;
  std::vector<MotionPiece> pieces_;
  double noise_scale_ = 1.0;
};

}  // namespace calipso::flow
