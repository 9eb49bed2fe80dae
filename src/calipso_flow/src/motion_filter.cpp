#include "calipso_flow/motion_filter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_flow/rotation.hpp"

namespace calipso::flow {
namespace {

// Offsets of the blocks in the error state.
constexpr int kP = 0, kV = 3, kA = 6, kR = 9, kW = 12;

// A quantity that a piece holds at zero keeps this share of its prior deviation, so that every
// covariance can be inverted.
constexpr double kZeroShare = 1e-7;

// After a collision a piece's speed is given at least this share of the prior's deviation.
constexpr double kLeastSpeedShare = 0.01;

using StateByPose = Eigen::Matrix<double, kStateSize, 6>;

Eigen::Matrix3d scaledIdentity(double value) { return value * Eigen::Matrix3d::Identity(); }

// Derivative of the predicted error by the present one.
StateMatrix transition(const MotionState& state, double dt) {
  StateMatrix F = StateMatrix::Identity();
  F.block<3, 3>(kP, kV) = scaledIdentity(dt);
  F.block<3, 3>(kP, kA) = scaledIdentity(0.5 * dt * dt);
  F.block<3, 3>(kV, kA) = scaledIdentity(dt);
  F.block<3, 3>(kR, kR) = rotationFromVector(state.spin * dt);
  F.block<3, 3>(kR, kW) = dt * (Eigen::Matrix3d::Identity() + 0.5 * skew(state.spin * dt));
  return F;
}

// F M for the F of transition(), block by block.
void applyTransition(const MotionState& state, double dt, StateMatrix& M) {
  const Eigen::Matrix3d turn = rotationFromVector(state.spin * dt);
  const Eigen::Matrix3d lean = dt * (Eigen::Matrix3d::Identity() + 0.5 * skew(state.spin * dt));
  M.middleRows<3>(kP) += dt * M.middleRows<3>(kV) + 0.5 * dt * dt * M.middleRows<3>(kA);
  M.middleRows<3>(kV) += dt * M.middleRows<3>(kA);
  M.middleRows<3>(kR) = (turn * M.middleRows<3>(kR) + lean * M.middleRows<3>(kW)).eval();
}

StateMatrix processNoise(const MotionPiece& piece, double dt) {
  StateMatrix Q = StateMatrix::Zero();
  if (piece.travel == Travel::kForced) {
    const double q = piece.jerk * piece.jerk;
    const double d2 = dt * dt, d3 = d2 * dt, d4 = d3 * dt, d5 = d4 * dt;
    Q.block<3, 3>(kP, kP) = scaledIdentity(q * d5 / 20.0);
    Q.block<3, 3>(kP, kV) = Q.block<3, 3>(kV, kP) = scaledIdentity(q * d4 / 8.0);
    Q.block<3, 3>(kP, kA) = Q.block<3, 3>(kA, kP) = scaledIdentity(q * d3 / 6.0);
    Q.block<3, 3>(kV, kV) = scaledIdentity(q * d3 / 3.0);
    Q.block<3, 3>(kV, kA) = Q.block<3, 3>(kA, kV) = scaledIdentity(q * d2 / 2.0);
    Q.block<3, 3>(kA, kA) = scaledIdentity(q * dt);
  }
  if (piece.turning == Turning::kForced) {
    const double q = piece.spin_noise * piece.spin_noise;
    Q.block<3, 3>(kR, kR) = scaledIdentity(q * dt * dt * dt / 3.0);
    Q.block<3, 3>(kR, kW) = Q.block<3, 3>(kW, kR) = scaledIdentity(q * dt * dt / 2.0);
    Q.block<3, 3>(kW, kW) = scaledIdentity(q * dt);
  }
  return Q;
}

// Deviations with which a piece's velocity and spin start; the acceleration's mean and covariance.
struct PieceStart {
  double velocity, spin;
  Eigen::Vector3d mean_acceleration = Eigen::Vector3d::Zero();
  Eigen::Matrix3d acceleration;
};

// Of free fall. How far away things are scales gravity; across it there is only drag.
Eigen::Matrix3d fallCovariance(const MotionPrior& prior) {
  const Eigen::Matrix3d along = prior.gravity * prior.gravity.transpose();
  const double across = std::pow(prior.drag_share, 2), scale = std::pow(prior.gravity_share, 2);
  return scaledIdentity(across * prior.gravity.squaredNorm()) + scale * along;
}

PieceStart pieceStart(const MotionPiece& piece, const MotionPrior& prior) {
  const bool rest = piece.travel == Travel::kRest, uniform = piece.travel == Travel::kUniform;
  PieceStart start;
  start.velocity = (rest ? kZeroShare : 1.0) * prior.velocity;
  start.spin = prior.spin;
  const double acceleration = (rest || uniform ? kZeroShare : 1.0) * prior.acceleration;
  start.acceleration = scaledIdentity(acceleration * acceleration);
  if (piece.travel == Travel::kFreeFall) {
    start.acceleration = fallCovariance(prior);
    start.mean_acceleration = prior.gravity;
  }
  if (piece.turning == Turning::kNone) start.spin *= kZeroShare;
  return start;
}

// Sets velocity, acceleration and spin as the piece starts with them.
void applyStart(const PieceStart& start, MotionState& state) {
  state.velocity.setZero();
  state.acceleration = start.mean_acceleration;
  state.spin.setZero();
  const auto reset = [&](int block, const Eigen::Matrix3d& covariance) {
    state.covariance.middleRows<3>(block).setZero();
    state.covariance.middleCols<3>(block).setZero();
    state.covariance.block<3, 3>(block, block) = covariance;
  };
  reset(kV, scaledIdentity(start.velocity * start.velocity));
  reset(kA, start.acceleration);
  reset(kW, scaledIdentity(start.spin * start.spin));
}

Vector6d innovation(const MotionState& state, const PoseMeasurement& measurement) {
  Vector6d r;
  r << measurement.position - state.position,
      vectorFromRotation(measurement.rotation * state.rotation.transpose());
  return r;
}

// P H^T: the columns of position and orientation.
StateByPose poseColumns(const StateMatrix& P) {
  StateByPose columns;
  columns << P.middleCols<3>(kP), P.middleCols<3>(kR);
  return columns;
}

Matrix6d innovationCovariance(const MotionState& state, const PoseMeasurement& measurement,
                              double noise_scale) {
  const StateByPose columns = poseColumns(state.covariance);
  Matrix6d S = noise_scale * noise_scale * measurement.covariance;
  S.topRows<3>() += columns.middleRows<3>(kP);
  S.bottomRows<3>() += columns.middleRows<3>(kR);
  return S;
}

void moveState(const StateVector& d, MotionState& state) {
  state.position += d.segment<3>(kP);
  state.velocity += d.segment<3>(kV);
  state.acceleration += d.segment<3>(kA);
  state.rotation = rotationFromVector(d.segment<3>(kR)) * state.rotation;
  state.spin += d.segment<3>(kW);
}

StateVector difference(const MotionState& to, const MotionState& from) {
  StateVector d;
  d << to.position - from.position, to.velocity - from.velocity,
      to.acceleration - from.acceleration,
      vectorFromRotation(to.rotation * from.rotation.transpose()), to.spin - from.spin;
  return d;
}

// One stop of the forward pass: a measurement, or the start of a piece.
struct Stop {
  MotionState arrived;   // before the measurement, or the piece's start state
  MotionState left;      // after the measurement; the same as `arrived` at a piece's start
  StateMatrix F;         // from the stop before
  int measurement = -1;  // index, or -1
  bool entry = false;    // the first stop of a piece, at the time of the stop before
  bool cut = false;
};

StateMatrix entryTransition(const MotionPiece& piece) {
  StateMatrix F = StateMatrix::Zero();
  if (piece.cut) return F;
  F.block<3, 3>(kP, kP).setIdentity();
  F.block<3, 3>(kR, kR).setIdentity();
  return F;
}

// The pass forward in time. `visit` is given every stop.
template <class Visit>
double passForward(const std::vector<PoseMeasurement>& measurements,
                   const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                   double noise_scale, Visit visit) {
  const double begin = measurements.front().time;
  size_t piece = 0;
  while (piece + 1 < pieces.size() && pieces[piece + 1].start <= begin) ++piece;
  MotionState state = initialState(begin, pieces[piece], prior, measurements.front());
  double sum = 0.0;
  for (size_t k = 0; k < measurements.size(); ++k) {
    const PoseMeasurement& measurement = measurements[k];
    while (piece + 1 < pieces.size() && pieces[piece + 1].start <= measurement.time) {
      const MotionPiece& next = pieces[piece + 1];
      Stop exit;
      exit.F = transition(state, next.start - state.time);
      exit.arrived = exit.left = state = predicted(state, next.start, pieces[piece]);
      visit(exit);
      Stop entry;
      entry.F = entryTransition(next);
      entry.entry = true;
      entry.cut = next.cut;
      entry.arrived = entry.left = state = enterPiece(state, next, prior);
      visit(entry);
      ++piece;
    }
    Stop stop;
    stop.measurement = static_cast<int>(k);
    stop.F = transition(state, measurement.time - state.time);
    stop.arrived = state = predicted(state, measurement, pieces[piece], noise_scale);
    if (measurement.valid)
      sum += correct(state, measurement, noise_scale) + oddsOf(measurement, pieces[piece]);
    stop.left = state;
    visit(stop);
  }
  return sum;
}

// Rauch-Tung-Striebel step: what the stop after tells about this one.
MotionState lookBack(const Stop& stop, const Stop& after, const MotionState& after_smoothed) {
  const StateMatrix cross = stop.left.covariance * after.F.transpose();
  const StateMatrix gain = after.arrived.covariance.ldlt().solve(cross.transpose()).transpose();
  MotionState smoothed = stop.left;
  moveState(gain * difference(after_smoothed, after.arrived), smoothed);
  smoothed.covariance +=
      gain * (after_smoothed.covariance - after.arrived.covariance) * gain.transpose();
  smoothed.covariance = (0.5 * (smoothed.covariance + smoothed.covariance.transpose())).eval();
  return smoothed;
}

}  // namespace

Matrix6d MotionState::twistCovariance() const {
  Matrix6d result;
  result << covariance.block<3, 3>(kV, kV), covariance.block<3, 3>(kV, kW),
      covariance.block<3, 3>(kW, kV), covariance.block<3, 3>(kW, kW);
  return result;
}

Eigen::Matrix3d MotionState::accelerationCovariance() const {
  return covariance.block<3, 3>(kA, kA);
}

void MotionState::setVelocityCovariance(const StateMatrix& other) {
  covariance.block<3, 3>(kV, kV) = other.block<3, 3>(kV, kV);
}

void MotionState::setSpinCovariance(const StateMatrix& other) {
  covariance.block<3, 3>(kW, kW) = other.block<3, 3>(kW, kW);
}

void MotionState::addScaleUncertainty(double relative) {
  const double variance = relative * relative;
  covariance.block<3, 3>(kV, kV) += variance * velocity * velocity.transpose();
  covariance.block<3, 3>(kA, kA) += variance * acceleration * acceleration.transpose();
}

void MotionState::addTwistCovariance(const Matrix6d& twist) {
  covariance.block<3, 3>(kV, kV) += twist.topLeftCorner<3, 3>();
  covariance.block<3, 3>(kV, kW) += twist.topRightCorner<3, 3>();
  covariance.block<3, 3>(kW, kV) += twist.bottomLeftCorner<3, 3>();
  covariance.block<3, 3>(kW, kW) += twist.bottomRightCorner<3, 3>();
}

MotionState initialState(double time, const MotionPiece& piece, const MotionPrior& prior,
                         const PoseMeasurement& first) {
  MotionState state;
  state.time = time;
  state.position = first.position;
  state.rotation = first.rotation;
  state.covariance.block<3, 3>(kP, kP) = scaledIdentity(prior.position * prior.position);
  state.covariance.block<3, 3>(kR, kR) = scaledIdentity(M_PI * M_PI);
  applyStart(pieceStart(piece, prior), state);
  return state;
}

MotionState enterPiece(const MotionState& before, const MotionPiece& piece,
                       const MotionPrior& prior) {
  MotionState state = before;
  PieceStart start = pieceStart(piece, prior);
  if (!piece.cut && piece.travel != Travel::kRest) {
    // A collision takes energy away: what comes out of it is about as fast as what went in.
    const double variance = before.covariance.block<3, 3>(kV, kV).trace();
    const double speed = std::sqrt(before.velocity.squaredNorm() + variance);
    start.velocity = std::min(start.velocity, std::max(speed, kLeastSpeedShare * start.velocity));
    state.covariance.block<3, 3>(kP, kP) += scaledIdentity(std::pow(speed * piece.contact, 2));
    state.covariance.block<3, 3>(kR, kR) += scaledIdentity(std::pow(prior.spin * piece.contact, 2));
  }
  applyStart(start, state);
  if (piece.cut) {
    state.covariance.block<3, 3>(kP, kP) = scaledIdentity(prior.position * prior.position);
    state.covariance.block<3, 3>(kR, kR) = scaledIdentity(M_PI * M_PI);
    state.covariance.block<3, 3>(kP, kR).setZero();
    state.covariance.block<3, 3>(kR, kP).setZero();
  }
  return state;
}

MotionState predicted(const MotionState& state, double time, const MotionPiece& piece) {
  const double dt = time - state.time;
  MotionState next = state;
  next.time = time;
  next.position += state.velocity * dt + state.acceleration * (0.5 * dt * dt);
  next.velocity += state.acceleration * dt;
  next.rotation = rotationFromVector(state.spin * dt) * state.rotation;
  applyTransition(state, dt, next.covariance);  // F P
  next.covariance.transposeInPlace();
  applyTransition(state, dt, next.covariance);  // F P^T F^T, P being symmetric
  next.covariance += processNoise(piece, dt);
  return next;
}

MotionState predicted(const MotionState& state, const PoseMeasurement& measurement,
                      const MotionPiece& piece, double noise_scale) {
  MotionState next = predicted(state, measurement.time, piece);
  if (!measurement.valid) return next;
  const Matrix6d drift = std::max(1.0, noise_scale * noise_scale) * measurement.drift;
  next.covariance.block<3, 3>(kP, kP) += drift.topLeftCorner<3, 3>();
  next.covariance.block<3, 3>(kP, kR) += drift.topRightCorner<3, 3>();
  next.covariance.block<3, 3>(kR, kP) += drift.bottomLeftCorner<3, 3>();
  next.covariance.block<3, 3>(kR, kR) += drift.bottomRightCorner<3, 3>();
  return next;
}

double correct(MotionState& state, const PoseMeasurement& measurement, double noise_scale) {
  const Matrix6d S = innovationCovariance(state, measurement, noise_scale);
  const Eigen::LLT<Matrix6d> factor(S);
  if (factor.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  // S = L L^T, Y = L^-1 H P: gain and covariance follow from one triangular solution.
  using PoseByState = Eigen::Matrix<double, 6, kStateSize>;
  PoseByState Y;
  Y << state.covariance.middleRows<3>(kP), state.covariance.middleRows<3>(kR);
  factor.matrixL().solveInPlace(Y);
  Vector6d r = innovation(state, measurement);
  factor.matrixL().solveInPlace(r);
  moveState(Y.transpose() * r, state);
  state.covariance.noalias() -= Y.transpose().lazyProduct(Y);
  const double log_determinant = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  return -0.5 * (r.squaredNorm() + log_determinant + 6.0 * std::log(2.0 * M_PI));
}

double squaredSurprise(const MotionState& state, const PoseMeasurement& measurement,
                       double noise_scale) {
  const Vector6d r = innovation(state, measurement);
  return r.dot(innovationCovariance(state, measurement, noise_scale).ldlt().solve(r));
}

double oddsOf(const PoseMeasurement& measurement, const MotionPiece& piece) {
  return piece.travel == Travel::kFreeFall ? measurement.falls : 0.0;
}

double logLikelihood(const std::vector<PoseMeasurement>& measurements,
                     const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                     double noise_scale) {
  return passForward(measurements, pieces, prior, noise_scale, [](const Stop&) {});
}

SmoothedMotion smooth(const std::vector<PoseMeasurement>& measurements,
                      const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                      double noise_scale) {
  SmoothedMotion motion;
  std::vector<Stop> stops;
  motion.log_likelihood = passForward(measurements, pieces, prior, noise_scale,
                                      [&](const Stop& stop) { stops.push_back(stop); });
  motion.states.resize(measurements.size());
  MotionState after;
  for (size_t i = stops.size(); i-- > 0;) {
    const bool last = i + 1 == stops.size();
    MotionState here = last ? stops[i].left : lookBack(stops[i], stops[i + 1], after);
    if (stops[i].measurement >= 0) motion.states[stops[i].measurement] = here;
    if (!last && stops[i + 1].entry) motion.jumps.push_back({here, after, stops[i + 1].cut});
    after = here;
  }
  std::reverse(motion.jumps.begin(), motion.jumps.end());
  return motion;
}

}  // namespace calipso::flow
