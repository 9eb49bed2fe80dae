#include "calipso_flow/wind_estimate.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sheet_simulation.hpp"

namespace calipso::flow {
namespace {

constexpr int kIterations = 8;
constexpr int kTrials = 3;             // halvings of a step that makes things worse
constexpr double kProbe = 0.2;         // m/s, of the finite differences
constexpr double kSettled = 0.02;      // m/s, a smaller step is the last
constexpr double kMostPersistent = 0.95;
constexpr int kFiner = 4;              // times the nodes at most
constexpr double kFirstGuess = 0.5;    // m/s: still air has no derivative, drag being quadratic

double hatAt(const std::vector<double>& knots, size_t i, double time) {
  if (i > 0 && time < knots[i]) {
    return std::max(0.0, (time - knots[i - 1]) / (knots[i] - knots[i - 1]));
  }
  if (i + 1 < knots.size() && time > knots[i]) {
    return std::max(0.0, (knots[i + 1] - time) / (knots[i + 1] - knots[i]));
  }
  return 1.0;
}

std::vector<double> knotsOver(double begin, double end, double spacing) {
  const int intervals = std::max(1, static_cast<int>(std::lround((end - begin) / spacing)));
  std::vector<double> knots;
  for (int i = 0; i <= intervals; ++i) knots.push_back(begin + (end - begin) * i / intervals);
  return knots;
}

// The least-squares problem: residuals of the simulated against the observed amplitudes.
class WindFit {
 public:
  WindFit(SheetSimulation& sheet, const ObjectModel& model, const std::vector<double>& times,
          const DeformationModes& modes, const Eigen::Vector3d& gravity, const WindParams& params)
      : sheet_(sheet), times_(times), modes_(modes), params_(params),
        down_(gravity.norm() > 0.0 ? Eigen::Vector3d(gravity.normalized()) : Eigen::Vector3d::Zero()) {
    const Eigen::Matrix3d R = model.world_from_object.linear();
    world_shapes_.resize(modes.shapes.rows(), modes.count());
    for (int m = 0; m < modes.count(); ++m) {
      const Eigen::Map<const Eigen::Matrix3Xd> shape(modes.shapes.col(m).data(), 3,
                                                     modes.shapes.rows() / 3);
      Eigen::Map<Eigen::Matrix3Xd>(world_shapes_.col(m).data(), 3, shape.cols()) = R * shape;
    }
    projector_ = (world_shapes_.transpose() * world_shapes_).ldlt();
    velocities_ = world_shapes_ * modes.velocities.row(0).transpose();
    const double motion = std::sqrt(modes.amplitudes.squaredNorm() / modes.amplitudes.rows());
    deviations_ = (modes.deviations.array().square() + std::pow(params.model_error * motion, 2)).sqrt();
  }

  // Amplitudes of the modes, T x K.
  Eigen::MatrixXd simulated(const std::vector<double>& knots, const Eigen::VectorXd& w) const {
    const auto wind = [&](double time) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (size_t i = 0; i < knots.size(); ++i) sum += hatAt(knots, i, time) * w.segment<3>(3 * i);
      return sum;
    };
    const std::vector<SurfaceVector> moved = sheet_.run(times_, velocities_, wind);
    Eigen::MatrixXd amplitudes(times_.size(), modes_.count());
    for (size_t k = 0; k < moved.size(); ++k) {
      amplitudes.row(k) = projector_.solve(world_shapes_.transpose() * moved[k]).transpose();
    }
    return amplitudes;
  }

  // Differences over their deviations, T x K flattened.
  Eigen::VectorXd residuals(const std::vector<double>& knots, const Eigen::VectorXd& w) const {
    const Eigen::MatrixXd difference =
        ((simulated(knots, w) - modes_.amplitudes).array() / (spread_ * deviations_.array())).matrix();
    return Eigen::Map<const Eigen::VectorXd>(difference.data(), difference.size());
  }

  // Information of what is known beforehand: wind is not endless, and changes slowly.
  Eigen::MatrixXd prior(const std::vector<double>& knots) const {
    const int n = static_cast<int>(knots.size());
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(3 * n, 3 * n);
    const double level = 1.0 / (n * params_.strongest * params_.strongest);
    const double upright = 1.0 / (n * params_.rising * params_.rising);
    const Eigen::Matrix3d weight = level * Eigen::Matrix3d::Identity() +
                                   (upright - level) * down_ * down_.transpose();
    for (int i = 0; i < n; ++i) P.block<3, 3>(3 * i, 3 * i) = weight;
    for (int i = 0; i + 1 < n; ++i) {
      const double weight = 1.0 / (params_.change * params_.change * (knots[i + 1] - knots[i]));
      for (int a = 0; a < 3; ++a) {
        const int p = 3 * i + a, q = p + 3;
        P(p, p) += weight, P(q, q) += weight, P(p, q) -= weight, P(q, p) -= weight;
      }
    }
    return P;
  }

  // Gauss-Newton from `w`; the Jacobian is carried on by Broyden's update, since each of its columns costs a
  // simulation, and made anew where it no longer leads down. @return information at the end
  Eigen::MatrixXd solve(const std::vector<double>& knots, Eigen::VectorXd& w) const {
    const Eigen::MatrixXd P = prior(knots);
    Eigen::VectorXd r = residuals(knots, w);
    double cost = r.squaredNorm() + w.dot(P * w);
    Eigen::MatrixXd J = jacobian(knots, w, r);
    bool fresh = true;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Eigen::VectorXd step = -(J.transpose() * J + P).ldlt().solve(J.transpose() * r + P * w);
      double share = 1.0;
      bool better = false;
      for (int trial = 0; trial < kTrials && !better; ++trial, share *= 0.4) {
        const Eigen::VectorXd taken = share * step, tried = w + taken;
        const Eigen::VectorXd left = residuals(knots, tried);
        const double value = left.squaredNorm() + tried.dot(P * tried);
        better = value < cost;
        J += (left - r - J * taken) * taken.transpose() / taken.squaredNorm();
        if (better) w = tried, r = left, cost = value;
      }
      if (better && step.cwiseAbs().maxCoeff() < kSettled) break;
      if (!better && fresh) break;
      fresh = !better;
      if (fresh) J = jacobian(knots, w, r);
    }
    return J.transpose() * J + P;
  }

  // What the simulation cannot show persists from frame to frame, and would otherwise outvote what is known
  // beforehand: from here on residuals count as the fewer independent ones that they are.
  void allowForPersistence(const std::vector<double>& knots, const Eigen::VectorXd& w) {
    const Eigen::VectorXd r = residuals(knots, w);
    const int frames = static_cast<int>(times_.size());
    double square = 0.0, product = 0.0;
    for (int m = 0; m < modes_.count(); ++m) {
      const auto series = r.segment(m * frames, frames);
      square += series.squaredNorm();
      product += series.tail(frames - 1).dot(series.head(frames - 1));
    }
    const double correlation = square > 0.0 ? std::clamp(product / square, 0.0, kMostPersistent) : 0.0;
    spread_ *= std::sqrt(std::max(1.0, square / r.size()) * (1.0 + correlation) / (1.0 - correlation));
  }

 private:
  Eigen::MatrixXd jacobian(const std::vector<double>& knots, const Eigen::VectorXd& w,
                           const Eigen::VectorXd& r) const {
    Eigen::MatrixXd J(r.size(), w.size());
    for (int p = 0; p < w.size(); ++p) {
      const Eigen::VectorXd probed = w + kProbe * Eigen::VectorXd::Unit(w.size(), p);
      J.col(p) = (residuals(knots, probed) - r) / kProbe;
    }
    return J;
  }

  SheetSimulation& sheet_;
  const std::vector<double>& times_;
  const DeformationModes& modes_;
  const WindParams& params_;
  Eigen::Vector3d down_;          // unit; zero without gravity
  Eigen::MatrixXd world_shapes_;  // 3 #V x K
  Eigen::LDLT<Eigen::MatrixXd> projector_;
  Eigen::VectorXd velocities_;    // of the surface in the key frame
  Eigen::MatrixXd deviations_;    // T x K
  double spread_ = 1.0;           // factor on them
};

// Across the sheet, towards the side to which it moves: what pushes it must come from the other one.
Eigen::Vector3d firstGuess(const ObjectModel& model, const DeformationModes& modes) {
  const Eigen::VectorXd shape = modes.shapes * modes.amplitudes.colwise().mean().transpose();
  const Eigen::Map<const Eigen::Matrix3Xd> u(shape.data(), 3, shape.size() / 3);
  const Eigen::Vector3d mean = model.world_from_object.linear() * u.rowwise().mean();
  return mean.norm() > 0.0 ? Eigen::Vector3d(kFirstGuess * mean.normalized()) : Eigen::Vector3d::Zero();
}

}  // namespace

Eigen::Vector3d WindEstimate::at(double time) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < knots.size(); ++i) sum += hatAt(knots, i, time) * wind[i];
  return sum;
}

Eigen::Matrix3d WindEstimate::covarianceAt(double time) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < knots.size(); ++i) sum += hatAt(knots, i, time) * covariance[i];
  return sum;
}

std::optional<WindEstimate> estimateWind(const ObjectModel& model, const std::vector<double>& times,
                                         const DeformationModes& modes, const Eigen::Vector3d& gravity,
                                         std::string& note, const WindParams& params) {
  if (modes.count() == 0 || times.size() < 3) return std::nullopt;
  std::optional<SheetSimulation> sheet;
  for (int nodes = params.nodes; !sheet && nodes <= kFiner * params.nodes; nodes *= 2) {
    try {
      sheet.emplace(model, gravity, nodes, params.longest_step);
    } catch (const std::exception& error) {
      note = std::string("no wind: ") + error.what();
    }
  }
  if (!sheet) return std::nullopt;
  note.clear();
  WindFit fit(*sheet, model, times, modes, gravity, params);
  // A steady wind first, then a changing one from there.
  Eigen::VectorXd w = firstGuess(model, modes);
  fit.solve({times.front()}, w);
  fit.allowForPersistence({times.front()}, w);
  WindEstimate estimate;
  estimate.knots = knotsOver(times.front(), times.back(), params.knot_spacing);
  const int count = static_cast<int>(estimate.knots.size());
  Eigen::VectorXd changing(3 * count);
  for (int i = 0; i < count; ++i) changing.segment<3>(3 * i) = w;
  const Eigen::MatrixXd information = fit.solve(estimate.knots, changing);
  const Eigen::MatrixXd covariance =
      information.ldlt().solve(Eigen::MatrixXd::Identity(3 * count, 3 * count));
  Eigen::MatrixXd average = Eigen::MatrixXd::Zero(3, 3 * count);
  for (int i = 0; i < count; ++i) {
    estimate.wind.push_back(changing.segment<3>(3 * i));
    estimate.covariance.push_back(covariance.block<3, 3>(3 * i, 3 * i));
    const double weight = (i == 0 || i + 1 == count ? 0.5 : 1.0) / (count - 1);
    average.block<3, 3>(0, 3 * i) = weight * Eigen::Matrix3d::Identity();
  }
  estimate.mean = average * changing;
  estimate.mean_covariance = average * covariance * average.transpose();
  estimate.amplitudes = fit.simulated(estimate.knots, changing);
  estimate.explained = 1.0 - (estimate.amplitudes - modes.amplitudes).squaredNorm() /
                                 modes.amplitudes.squaredNorm();
  if (estimate.explained < params.least_explained) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "no wind: the simulated sheet shows %.0f %% of the motion at best; another material "
                  "or hold may", 100.0 * std::max(0.0, estimate.explained));
    note = text;
    return std::nullopt;
  }
  return estimate;
}

}  // namespace calipso::flow
