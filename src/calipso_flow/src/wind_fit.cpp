#include "calipso_flow/wind_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace calipso::flow {
namespace {

constexpr double kKnotSpacing = 0.25;  // s
constexpr int kSamples = 40;           // vertices whose motion is compared
constexpr double kIndependent = 6.0;   // of their coordinates, per frame
constexpr double kMisfit = 0.1;        // of the motion: what the simulation cannot follow
constexpr double kLargestWind = 10.0;  // m/s, deviation of the prior
constexpr double kGust = 3.0;          // m/s of change from knot to knot, deviation of the prior
constexpr double kProbe = 2.0;         // m/s, of the finite differences
constexpr int kIterations = 4;
constexpr int kFreshDerivatives = 2;   // iterations that take new derivatives

// The wind by its signed squares s = |w| w at knots: the pressure is nearly linear in s.
class WindKnots {
 public:
  explicit WindKnots(const std::vector<double>& times)
      : start_(times.front()),
        count_(std::max(2, 1 + static_cast<int>(std::ceil((times.back() - start_) / kKnotSpacing)))) {}

  int count() const { return count_; }
  // Weight of knot j at `time`.
  double weight(int j, double time) const {
    return std::max(0.0, 1.0 - std::abs((time - start_) / kKnotSpacing - j));
  }
  Eigen::Vector3d squares(const Eigen::VectorXd& s, double time) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int j = 0; j < count_; ++j) sum += weight(j, time) * s.segment<3>(3 * j);
    return sum;
  }

 private:
  double start_;
  int count_;
};

Eigen::Vector3d windOf(const Eigen::Vector3d& squares) {
  const double length = squares.norm();
  return length > 0.0 ? Eigen::Vector3d(squares / std::sqrt(length)) : Eigen::Vector3d::Zero();
}

// Samples of surfaces, one column per frame, relative to the first.
Eigen::MatrixXd sampled(const std::vector<ClothSimulation::Vertices>& surfaces) {
  const int vertices = static_cast<int>(surfaces.front().rows());
  const int count = std::min(kSamples, vertices);
  Eigen::MatrixXd result(3 * count, surfaces.size());
  for (size_t k = 0; k < surfaces.size(); ++k) {
    for (int i = 0; i < count; ++i) {
      const int v = static_cast<int>(static_cast<long>(i) * vertices / count);
      result.block<3, 1>(3 * i, k) =
          (surfaces[k].row(v) - surfaces.front().row(v)).transpose();
    }
  }
  return result;
}

class Fit {
 public:
  Fit(const ObjectModel& model, const Eigen::Vector3d& gravity, const std::vector<double>& times,
      const std::vector<ClothSimulation::Vertices>& surfaces,
      const ClothSimulation::Vertices& velocity)
      : simulation_(model, gravity), times_(times), velocity_(velocity), knots_(times),
        observed_(sampled(surfaces)) {
    const double motion = std::sqrt(observed_.squaredNorm() / observed_.size());
    sigma_ = std::max(1e-9, kMisfit * motion) *
             std::sqrt(static_cast<double>(observed_.rows()) / kIndependent);
  }

  WindEstimate run() {
    Eigen::VectorXd s = Eigen::VectorXd::Zero(3 * knots_.count());
    Eigen::MatrixXd y = simulate(s);
    double cost = costOf(s, y);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      if (iteration < kFreshDerivatives) differentiate(s, y);
      Eigen::VectorXd step = solve(s, y);
      bool better = false;
      for (int half = 0; half < 3 && !better; ++half, step *= 0.4) {
        const Eigen::MatrixXd next = simulate(s + step);
        const double next_cost = costOf(s + step, next);
        better = next_cost < cost;
        if (better) s += step, y = next, cost = next_cost;
      }
      if (!better || step.norm() < 1e-2 * (1.0 + s.norm())) {
        if (iteration + 1 >= kFreshDerivatives) break;
      }
    }
    return describe(s, y);
  }

 private:
  Eigen::MatrixXd simulate(const Eigen::VectorXd& s) {
    const auto wind = [&](double time) { return windOf(knots_.squares(s, time)); };
    return sampled(simulation_.run(times_, wind, velocity_));
  }

  double costOf(const Eigen::VectorXd& s, const Eigen::MatrixXd& y) const {
    return (y - observed_).squaredNorm() / (sigma_ * sigma_) + s.dot(prior() * s);
  }

  // Signed squares about zero, and changes between knots.
  Eigen::MatrixXd prior() const {
    const double size = kLargestWind * kLargestWind, change = kGust * kGust;
    Eigen::MatrixXd P =
        Eigen::MatrixXd::Identity(3 * knots_.count(), 3 * knots_.count()) / (size * size);
    for (int r = 0; r + 3 < P.rows(); ++r) {
      const double w = 1.0 / (change * change);
      P(r, r) += w, P(r + 3, r + 3) += w, P(r, r + 3) -= w, P(r + 3, r) -= w;
    }
    return P;
  }

  // Answers to a change at the first and at the second knot; those to later knots are the second's,
  // shifted in time: the cloth answers later as it answers now.
  void differentiate(const Eigen::VectorXd& s, const Eigen::MatrixXd& y) {
    derivative_.assign(3 * knots_.count(), Eigen::MatrixXd());
    const double probe = kProbe * kProbe;
    for (int axis = 0; axis < 3; ++axis) {
      for (int j = 0; j < 2; ++j) {
        const Eigen::VectorXd d = probe * Eigen::VectorXd::Unit(s.size(), 3 * j + axis);
        derivative_[3 * j + axis] = (simulate(s + d) - y) / probe;
      }
      for (int j = 2; j < knots_.count(); ++j) {
        derivative_[3 * j + axis] = shifted(derivative_[3 + axis], (j - 1) * kKnotSpacing);
      }
    }
  }

  Eigen::MatrixXd shifted(const Eigen::MatrixXd& y, double delay) const {
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(y.rows(), y.cols());
    size_t before = 0;
    for (size_t k = 0; k < times_.size(); ++k) {
      const double time = times_[k] - delay;
      if (time <= times_.front()) continue;
      while (before + 2 < times_.size() && times_[before + 1] < time) ++before;
      const double share = (time - times_[before]) / (times_[before + 1] - times_[before]);
      result.col(k) = (1.0 - share) * y.col(before) + share * y.col(before + 1);
    }
    return result;
  }

  Eigen::MatrixXd normal() const {
    const int n = static_cast<int>(derivative_.size());
    Eigen::MatrixXd N = prior();
    for (int a = 0; a < n; ++a) {
      for (int b = 0; b < n; ++b) {
        N(a, b) += derivative_[a].cwiseProduct(derivative_[b]).sum() / (sigma_ * sigma_);
      }
    }
    return N;
  }

  Eigen::VectorXd solve(const Eigen::VectorXd& s, const Eigen::MatrixXd& y) const {
    Eigen::VectorXd right = -prior() * s;
    for (int a = 0; a < right.size(); ++a) {
      right[a] -= derivative_[a].cwiseProduct(y - observed_).sum() / (sigma_ * sigma_);
    }
    return normal().ldlt().solve(right);
  }

  WindEstimate describe(const Eigen::VectorXd& s, const Eigen::MatrixXd& y) const {
    WindEstimate estimate;
    estimate.density = simulation_.density();
    estimate.explained = 1.0 - (y - observed_).squaredNorm() / observed_.squaredNorm();
    const Eigen::MatrixXd covariance =
        normal().ldlt().solve(Eigen::MatrixXd::Identity(s.size(), s.size()));
    for (const double time : times_) {
      const Eigen::Vector3d square = knots_.squares(s, time);
      Eigen::MatrixXd B = Eigen::MatrixXd::Zero(3, s.size());
      for (int j = 0; j < knots_.count(); ++j) {
        B.block<3, 3>(0, 3 * j) = knots_.weight(j, time) * Eigen::Matrix3d::Identity();
      }
      // w = s / sqrt(|s|);  dw/ds = (I - s s^T / (2 |s|^2)) / sqrt(|s|). In a calm it is not defined:
      // one m/s is taken.
      const double length = std::max(1.0, square.norm());
      const Eigen::Matrix3d slope =
          (Eigen::Matrix3d::Identity() - 0.5 * square * square.transpose() / (length * length)) /
          std::sqrt(length);
      estimate.velocity.push_back(windOf(square));
      estimate.covariance.push_back(slope * B * covariance * B.transpose() * slope);
    }
    return estimate;
  }

  ClothSimulation simulation_;
  const std::vector<double>& times_;
  const ClothSimulation::Vertices& velocity_;
  WindKnots knots_;
  Eigen::MatrixXd observed_;
  double sigma_;
  std::vector<Eigen::MatrixXd> derivative_;  // of the samples by each component of each knot
};

}  // namespace

WindEstimate fitWind(const ObjectModel& model, const Eigen::Vector3d& gravity,
                     const std::vector<double>& times,
                     const std::vector<ClothSimulation::Vertices>& surfaces,
                     const ClothSimulation::Vertices& velocity) {
  if (times.size() != surfaces.size() || times.size() < 3) {
    throw std::invalid_argument("wind: " + std::to_string(surfaces.size()) + " shapes at " +
                                std::to_string(times.size()) +
                                " times; give one each, and at least three");
  }
  WindEstimate estimate = Fit(model, gravity, times, surfaces, velocity).run();
  estimate.drag = dragOf(model.mesh);
  const ClothSimulation::Vertices still =
      ClothSimulation::Vertices::Zero(model.mesh.vertexCount(), 3);
  for (size_t k = 0; k < times.size(); ++k) {
    const auto forces =
        windForces(model.mesh, surfaces[k], still, estimate.velocity[k], estimate.drag);
    estimate.pressure.push_back(forces.colwise().sum().transpose() / sheetArea(model.mesh));
  }
  return estimate;
}

}  // namespace calipso::flow
