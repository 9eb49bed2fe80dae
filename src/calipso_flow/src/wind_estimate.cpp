#include "calipso_flow/wind_estimate.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <stdexcept>

#include <calipso_fem/voxel_grid.hpp>

#include "sheet_simulation.hpp"

namespace calipso::flow {
namespace {

constexpr int kIterations = 8;
constexpr int kTrials = 3;             // halvings of a step that makes things worse
constexpr double kProbe = 0.2;         // m/s, of the finite differences
constexpr double kSettled = 0.02;      // m/s, a smaller step is the last
constexpr double kSeen = 3.0;          // the pictures' information over that beforehand: half of the deviation
constexpr double kSeenShare = 0.03;    // of the best direction's
constexpr double kWellShown = 0.95;    // of the motion's square: no other valley is looked for
constexpr double kHardlyShown = 0.5;
constexpr double kStiffStart = 2.5;    // log s
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

double cellSizeFor(const TriangleMesh& mesh, int nodes) {
  fem::VoxelizeOptions options;
  options.target_nodes = nodes;
  return fem::voxelize(mesh, options).cell_size;
}

// The sheet at any stiffness: the two last asked for are kept, since probing goes back and forth.
class SheetFamily {
 public:
  // @throw as SheetSimulation
  // @param given  every member is as stiff as the simulator starts with, on this grid
  SheetFamily(const ObjectModel& model, const Eigen::Vector3d& gravity, int nodes, const WindParams& params, bool given)
      : model_(model), gravity_(gravity), nodes_(nodes), step_(params.longest_step), given_(given) {
    const double own = cellSizeFor(model.mesh, nodes), simulator = cellSizeFor(model.mesh, params.simulator_nodes);
    scale_ = std::pow(simulator / own, 2);
    at(kStiffStart);
    at(0.0);
  }

  bool given() const { return given_; }

  // @param log_stiffness  of the modulus over that which the simulator starts with, on its grid
  SheetSimulation& at(double log_stiffness) {
    if (given_) log_stiffness = -std::log(scale_);
    if (kept_[1].sheet && kept_[1].log_stiffness == log_stiffness) std::swap(kept_[0], kept_[1]);
    if (!kept_[0].sheet || kept_[0].log_stiffness != log_stiffness) {
      std::swap(kept_[0], kept_[1]);
      kept_[0] = {log_stiffness, std::make_unique<SheetSimulation>(model_, gravity_, nodes_, step_,
                                                                  scale_ * std::exp(log_stiffness))};
    }
    return *kept_[0].sheet;
  }

  double stiffnessOverDensity(double log_stiffness) { return at(log_stiffness).stiffnessRatio() / scale_; }

 private:
  struct Kept {
    double log_stiffness = 0.0;
    std::unique_ptr<SheetSimulation> sheet;
  };
  const ObjectModel& model_;
  Eigen::Vector3d gravity_;
  int nodes_;
  double step_;
  bool given_;
  double scale_;  // modulus with which this grid bends as the simulator's does, over the latter's
  std::array<Kept, 2> kept_;
};

// The least-squares problem: residuals of the simulated against the observed amplitudes.
class WindFit {
 public:
  WindFit(SheetFamily& sheets, const ObjectModel& model, const std::vector<double>& times,
          const DeformationModes& modes, const Eigen::Vector3d& gravity, const WindParams& params)
      : sheets_(sheets), times_(times), modes_(modes), params_(params),
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

  // Amplitudes of the modes, T x K. @param w  the wind at the knots, one after the other, then log s
  Eigen::MatrixXd simulated(const std::vector<double>& knots, const Eigen::VectorXd& w) const {
    const auto wind = [&](double time) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (size_t i = 0; i < knots.size(); ++i) sum += hatAt(knots, i, time) * w.segment<3>(3 * i);
      return sum;
    };
    const std::vector<SurfaceVector> moved = sheets_.at(w[3 * knots.size()]).run(times_, velocities_, wind);
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

  // Empty where the sheet is too soft to hang in its shape.
  Eigen::VectorXd residualsOrNone(const std::vector<double>& knots, const Eigen::VectorXd& w) const {
    try {
      return residuals(knots, w);
    } catch (const std::exception&) {
      return Eigen::VectorXd();
    }
  }

  // Information of what is known beforehand: wind is not endless, and changes slowly.
  Eigen::MatrixXd prior(const std::vector<double>& knots) const {
    const int n = static_cast<int>(knots.size());
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(3 * n + 1, 3 * n + 1);
    P(3 * n, 3 * n) = 1.0 / (params_.stiffness * params_.stiffness);
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
      const Eigen::VectorXd step = stepFrom(J, P, r, w);
      double share = 1.0;
      bool better = false;
      for (int trial = 0; trial < kTrials && !better; ++trial, share *= 0.4) {
        const Eigen::VectorXd taken = share * step, tried = w + taken;
        const Eigen::VectorXd left = residualsOrNone(knots, tried);
        if (left.size() == 0) continue;
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
    w = seenPart(J, P, w);
    return J.transpose() * J + P;
  }

  // Gauss-Newton's step. Where the picture says little more than what was known beforehand, as of wind along the
  // sheet, it would follow the errors of the simulation: there w goes to what was known beforehand.
  Eigen::VectorXd stepFrom(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P, const Eigen::VectorXd& r,
                                  const Eigen::VectorXd& w) const {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> seen(J.transpose() * J, P);
    const Eigen::MatrixXd& V = seen.eigenvectors();  // V' P V = 1
    const Eigen::VectorXd beforehand = V.transpose() * (P * w), pictures = V.transpose() * (J.transpose() * r);
    Eigen::VectorXd along(w.size());
    for (int i = 0; i < w.size(); ++i) {
      const double information = seen.eigenvalues()[i];
      along[i] = information > leastInformation(seen.eigenvalues()) ? (pictures[i] + beforehand[i]) / (information + 1.0) : beforehand[i];
    }
    return -(V * along);
  }

  // Wind and log s. A stiff sheet in much wind and a soft one in little are two valleys: the better of both ends. Where
  // neither shows the motion, it is for a changing wind to do, on the stiff one, which answers it more evenly.
  Eigen::VectorXd steady(const Eigen::Vector3d& guess) const {
    const std::vector<double> knot{times_.front()};
    const double motion = (modes_.amplitudes.array() / deviations_.array()).matrix().squaredNorm();
    Eigen::VectorXd best, w(4);
    double least = std::numeric_limits<double>::infinity(), shown = 0.0;
    for (const double log_stiffness : {0.0, kStiffStart}) {
      w << guess, log_stiffness;
      if (residualsOrNone(knot, w).size() == 0) continue;
      solve(knot, w);
      const double left = residuals(knot, w).squaredNorm(), cost = left + w.dot(prior(knot) * w);
      if (cost < least) least = cost, best = w, shown = 1.0 - left / motion;
      if (shown > kWellShown || sheets_.given()) break;
    }
    return shown < kHardlyShown && w[3] > 0.5 * kStiffStart ? w : best;
  }

  // w, as it was known beforehand where the pictures say no more.
  Eigen::VectorXd seenPart(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P, const Eigen::VectorXd& w) const {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> seen(J.transpose() * J, P);
    const Eigen::MatrixXd& V = seen.eigenvectors();
    const Eigen::VectorXd along = (seen.eigenvalues().array() > leastInformation(seen.eigenvalues())).select(V.transpose() * (P * w), 0.0);
    return V * along;
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
      const Eigen::VectorXd probe = kProbe * Eigen::VectorXd::Unit(w.size(), p);
      const Eigen::VectorXd beyond = residualsOrNone(knots, w + probe);
      J.col(p) = beyond.size() > 0 ? Eigen::VectorXd((beyond - r) / kProbe)
                                   : Eigen::VectorXd((r - residuals(knots, w - probe)) / kProbe);
    }
    return J;
  }

  double leastInformation(const Eigen::VectorXd& information) const {
    return sheets_.given() ? -1.0 : std::min(kSeen, kSeenShare * information.maxCoeff());
  }

  SheetFamily& sheets_;
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

// @param given  the sheet is as stiff as the simulator starts with; else that is fitted, too
std::optional<WindEstimate> fitWind(const ObjectModel& model, const std::vector<double>& times,
                                    const DeformationModes& modes, const Eigen::Vector3d& gravity, bool given,
                                    std::string& note, const WindParams& params) {
  std::optional<SheetFamily> sheets;
  for (int nodes = params.nodes; !sheets && nodes <= kFiner * params.nodes; nodes *= 2) {
    try {
      sheets.emplace(model, gravity, nodes, params, given);
    } catch (const std::exception& error) {
      note = std::string("no wind: ") + error.what();
    }
  }
  if (!sheets) return std::nullopt;
  note.clear();
  WindFit fit(*sheets, model, times, modes, gravity, params);
  // A steady wind first, then a changing one from there.
  Eigen::VectorXd steady = fit.steady(firstGuess(model, modes));
  if (steady.size() == 0) {
    note = "no wind: the sheet finds no equilibrium in its shape; see where it is held";
    return std::nullopt;
  }
  fit.allowForPersistence({times.front()}, steady);
  WindEstimate estimate;
  estimate.knots = knotsOver(times.front(), times.back(), params.knot_spacing);
  const int count = static_cast<int>(estimate.knots.size());
  Eigen::VectorXd changing(3 * count + 1);
  for (int i = 0; i < count; ++i) changing.segment<3>(3 * i) = steady.head<3>();
  changing[3 * count] = steady[3];
  const Eigen::MatrixXd information = fit.solve(estimate.knots, changing);
  const Eigen::MatrixXd covariance =
      information.ldlt().solve(Eigen::MatrixXd::Identity(3 * count + 1, 3 * count + 1));
  if (!given) estimate.stiffness_over_density = sheets->stiffnessOverDensity(changing[3 * count]);
  estimate.stiffness_over_density_deviation =
      estimate.stiffness_over_density * std::sqrt(covariance(3 * count, 3 * count));
  Eigen::MatrixXd average = Eigen::MatrixXd::Zero(3, 3 * count + 1);
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

// A motion that no hanging sheet makes, such as a wave that something else drives, may lead stiffness and wind together
// astray: then the wind alone is fitted as well, and what shows more of the motion is taken.
std::optional<WindEstimate> estimateWind(const ObjectModel& model, const std::vector<double>& times,
                                         const DeformationModes& modes, const Eigen::Vector3d& gravity,
                                         std::string& note, const WindParams& params) {
  if (modes.count() == 0 || times.size() < 3) return std::nullopt;
  const auto free = fitWind(model, times, modes, gravity, false, note, params);
  if (free && free->explained > kWellShown) return free;
  const auto given = fitWind(model, times, modes, gravity, true, note, params);
  if (free || given) note.clear();
  return !given || (free && free->explained > given->explained) ? free : given;
}

}  // namespace calipso::flow
