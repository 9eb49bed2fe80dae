#include "calipso_flow/live_deformation.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "field_metric.hpp"

namespace calipso::flow {
namespace {

constexpr double kForget = 1.0;  // s, over which surprises fade
// Jerks that are tried, in lengths of the object: of a slow sway and of a hard flutter.
constexpr double kLeastJerk = 1.0, kJerkRatio = 4.0;
constexpr int kJerks = 6;
constexpr double kSpeed = 10.0, kAcceleration = 100.0;  // lengths: as good as nothing known
constexpr double kLeastDeviation = 1e-5;                // of the length

Eigen::Matrix3d transition(double h) {
  Eigen::Matrix3d F;
  F << 1.0, h, 0.5 * h * h, 0.0, 1.0, h, 0.0, 0.0, 1.0;
  return F;
}

// Of white jerk with unit density.
Eigen::Matrix3d drift(double h) {
  const double h2 = h * h, h3 = h2 * h;
  Eigen::Matrix3d Q;
  Q << h3 * h2 / 20.0, h2 * h2 / 8.0, h3 / 6.0, h2 * h2 / 8.0, h3 / 3.0, h2 / 2.0, h3 / 6.0,
      h2 / 2.0, h;
  return Q;
}

}  // namespace

CoarseModes coarseModesOf(const DeformableTracker& tracker, int count) {
  const DeformationField::Weights& weights = tracker.vertexWeights();
  const Eigen::MatrixXd G = meanSquare(weights), H = tracker.fitter().priorInformation();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(H, G);  // smallest first
  const Eigen::MatrixXd controls =
      solver.eigenvectors().leftCols(std::min<Eigen::Index>(count, G.cols()));
  CoarseModes modes;
  modes.dual = G * controls;
  modes.shapes.resize(3 * weights.rows(), controls.cols());
  for (Eigen::Index m = 0; m < controls.cols(); ++m) {
    modes.shapes.col(m) = vertexShape(weights, controls.col(m));
  }
  return modes;
}

ModeFilter::ModeFilter(int modes, double length) : length_(length) {
  for (int j = 0; j < kJerks; ++j) {
    Filter filter;
    filter.jerk = length * kLeastJerk * std::pow(kJerkRatio, j);
    filter.modes.resize(modes);
    filters_.push_back(filter);
  }
}

void ModeFilter::predict(double time) {
  const double h = time - time_;
  const Eigen::Matrix3d F = transition(h), Q = drift(h);
  for (Filter& filter : filters_) {
    filter.surprise *= std::exp(-h / kForget);
    for (ModeState& mode : filter.modes) {
      mode.mean = F * mode.mean;
      mode.covariance = F * mode.covariance * F.transpose() + filter.jerk * filter.jerk * Q;
    }
  }
  time_ = time;
}

void ModeFilter::skip(double time) {
  if (started_) predict(time);
}

void ModeFilter::add(double time, const Eigen::VectorXd& amplitudes,
                     const Eigen::VectorXd& deviations, bool cut) {
  const bool fresh = !started_ || cut;
  if (fresh) {
    time_ = time, started_ = true;
  } else {
    predict(time);
  }
  const double speed = kSpeed * length_, acceleration = kAcceleration * length_;
  for (Filter& filter : filters_) {
    for (size_t m = 0; m < filter.modes.size(); ++m) {
      ModeState& mode = filter.modes[m];
      const double noise = std::max(deviations[m], kLeastDeviation * length_);
      if (fresh) {
        mode.mean << amplitudes[m], 0.0, 0.0;
        mode.covariance =
            Eigen::Vector3d(noise * noise, speed * speed, acceleration * acceleration).asDiagonal();
        continue;
      }
      const double variance = mode.covariance(0, 0) + noise * noise;
      const double innovation = amplitudes[m] - mode.mean[0];
      filter.surprise += innovation * innovation / variance + std::log(variance);
      const Eigen::Vector3d gain = mode.covariance.col(0) / variance;
      mode.mean += gain * innovation;
      mode.covariance -= gain * mode.covariance.row(0).eval();
    }
  }
}

const ModeFilter::Filter& ModeFilter::best() const {
  return *std::min_element(filters_.begin(), filters_.end(), [](const Filter& a, const Filter& b) {
    return a.surprise < b.surprise;
  });
}

Eigen::VectorXd ModeFilter::amplitudes() const {
  const std::vector<ModeState>& modes = best().modes;
  return Eigen::VectorXd::NullaryExpr(modes.size(),
                                      [&](Eigen::Index m) { return modes[m].mean[0]; });
}

Eigen::VectorXd ModeFilter::velocities() const {
  const std::vector<ModeState>& modes = best().modes;
  return Eigen::VectorXd::NullaryExpr(modes.size(),
                                      [&](Eigen::Index m) { return modes[m].mean[1]; });
}

Eigen::VectorXd ModeFilter::velocityDeviations() const {
  const std::vector<ModeState>& modes = best().modes;
  return Eigen::VectorXd::NullaryExpr(
      modes.size(), [&](Eigen::Index m) { return std::sqrt(modes[m].covariance(1, 1)); });
}

}  // namespace calipso::flow
