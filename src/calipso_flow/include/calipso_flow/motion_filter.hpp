#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "calipso_flow/pose_fit.hpp"

namespace calipso::flow {

// A body's motion as a linear Gaussian state space (a Kalman filter with a Rauch-Tung-Striebel
// smoother), in pieces between instants at which velocity may jump. World axes, SI units.
//
//   state   x = (p, v, a, R, w): centroid, its velocity and acceleration, orientation, spin
//   motion  dp = v dt, dv = a dt, da = white noise of density jerk^2
//           dR = skew(w) R dt, dw = white noise of density spin_noise^2
//   errors  d = (dp, dv, da, dtheta, dw), orientation by R <- exp(dtheta) R

constexpr int kStateSize = 15;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;
using StateVector = Eigen::Matrix<double, kStateSize, 1>;

struct MotionState {
  double time = 0.0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      // m, of the centroid
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      // m/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // m/s^2
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // world_from_object
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();          // rad/s
  StateMatrix covariance = StateMatrix::Zero();

  // Covariance of (velocity, spin).
  Matrix6d twistCovariance() const;
  Eigen::Matrix3d accelerationCovariance() const;
  // Widens velocity and acceleration along themselves by a relative deviation of the scale.
  void addScaleUncertainty(double relative);
  // Widens velocity and spin by the covariance of an error that they have besides.
  void addTwistCovariance(const Matrix6d& twist);
  // Replaces one block by that of another covariance.
  void setVelocityCovariance(const StateMatrix& other);
  void setSpinCovariance(const StateMatrix& other);
};

struct PoseMeasurement {
  double time = 0.0;  // s
  Eigen::Vector3d position;
  Eigen::Matrix3d rotation;
  Matrix6d covariance;                 // of (m, rad), independent from time to time
  bool valid = false;                  // false: nothing was seen at this time
  Matrix6d common = Matrix6d::Zero();  // of errors that change slowly
  // Of how an error has changed since the valid measurement before, which otherwise persists: the
  // state's pose holds it.
  Matrix6d drift = Matrix6d::Zero();
  // What is known of the surroundings, as log odds: that it falls freely at this time rather than
  // being held, and that since the measurement before it has struck something, besides the usual.
  double falls = 0.0, strikes = 0.0;
  // When since the measurement before it reaches the surroundings if it goes on falling as it did
  // in the two before, s, with its standard deviation.
  struct Instant {
    double time, deviation;
  };
  std::optional<Instant> contact = std::nullopt;
};

enum class Travel { kRest, kUniform, kFreeFall, kAccelerated, kForced };
enum class Turning { kNone, kSteady, kForced };

// One piece of the motion and what is assumed about it.
struct MotionPiece {
  double start = 0.0;  // s; the first piece's start is not read
  bool cut = false;    // the video was cut here: nothing carries over
  // s; > 0: several impacts within about so long, between which it moves at an unknown rate
  double contact = 0.0;
  Travel travel = Travel::kForced;
  Turning turning = Turning::kForced;
  double jerk = 0.0;        // m/s^3 per square root of Hz; kForced only
  double spin_noise = 0.0;  // rad/s^2 per square root of Hz; kForced only
};

// What is known before anything is seen: standard deviations about zero, and gravity.
struct MotionPrior {
  double position = 1e3;                        // m
  double velocity = 10.0;                       // m/s
  double acceleration = 100.0;                  // m/s^2
  double spin = 30.0;                           // rad/s
  Eigen::Vector3d gravity = {0.0, 0.0, -9.81};  // m/s^2
  double gravity_share = 0.05;                  // relative uncertainty of free fall: scale
  double drag_share = 0.005;                    // of gravity, in every direction: drag
};

// A jump between two pieces, with the state on either side of it.
struct Jump {
  MotionState before, after;
  bool cut = false;
};

struct SmoothedMotion {
  std::vector<MotionState> states;  // one per measurement, in order
  std::vector<Jump> jumps;          // one per piece after the first that starts within the clip
  double log_likelihood = 0.0;      // of the measurements, given the pieces
};

// What PoseMeasurement::falls adds to a piece's log likelihood.
double oddsOf(const PoseMeasurement& measurement, const MotionPiece& piece);

// @param noise_scale  factor on the measurements' standard deviations
// @pre measurements and pieces are in order of time, and neither is empty
double logLikelihood(const std::vector<PoseMeasurement>& measurements,
                     const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                     double noise_scale);
SmoothedMotion smooth(const std::vector<PoseMeasurement>& measurements,
                      const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                      double noise_scale);

// One step of the same filter, for frames as they come (live mode).
MotionState predicted(const MotionState& state, double time, const MotionPiece& piece);
// The same at the time of a measurement, whose error may have drifted: by more than is stated where
// measurements err by more than they state.
MotionState predicted(const MotionState& state, const PoseMeasurement& measurement,
                      const MotionPiece& piece, double noise_scale);
// Takes a measurement in. @return the log of its likelihood
double correct(MotionState& state, const PoseMeasurement& measurement, double noise_scale);
// Squared Mahalanobis length of the innovation, 6 degrees of freedom.
double squaredSurprise(const MotionState& state, const PoseMeasurement& measurement,
                       double noise_scale);
// The state at the start of a piece that follows `before`.
MotionState enterPiece(const MotionState& before, const MotionPiece& piece,
                       const MotionPrior& prior);
// The state before the first measurement.
MotionState initialState(double time, const MotionPiece& piece, const MotionPrior& prior,
                         const PoseMeasurement& first);

}  // namespace calipso::flow
