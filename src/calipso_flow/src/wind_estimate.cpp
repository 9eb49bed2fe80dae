#include "calipso_flow/wind_estimate.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <calipso_fem/voxel_grid.hpp>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <stdexcept>

#include "sheet_simulation.hpp"

namespace calipso::flow {
namespace {

constexpr int kTrials = 8;    // steps of one fit, also those that make things worse
constexpr int kFailures = 2;  // of these in a row
constexpr double kLeastDamping = 0.3, kDamping = 5.0;
// log s: how much stiffer the sheet is that shows what stiffness does
constexpr double kStiffer = 0.05;
constexpr double kSettled = 0.02;  // m/s, a smaller step is the last
constexpr double kGained = 1e-2;   // of the cost: less gained, and it was the last step
// the pictures' information over that beforehand: half of the deviation
constexpr double kSeen = 3.0;
constexpr double kSeenShare = 0.03;  // of the best direction's
constexpr double kWellShown = 0.95;  // of the motion's square: no other valley is looked for
constexpr double kHardlyShown = 0.5;
constexpr double kStiffStart = 2.5;  // log s
constexpr double kMostPersistent = 0.95;
constexpr int kFiner = 4;  // times the nodes at most
constexpr char kNoEquilibrium[] =
    "no wind: the sheet finds no equilibrium in its shape; see where it is held";
constexpr double kGuesses[] = {1.0, 2.0, 4.0,
                               8.0};  // m/s: still air has no derivative, drag being quadratic

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

// The sheet at any stiffness; those last asked for are kept, and what is asked for next starts from
// them.
class SheetFamily {
 public:
  // @throw as SheetSimulation
  // @param cell, simulator_cell  edges of this grid's cubes and of the simulator's, m
  // @param given  every member is as stiff as the simulator starts with, on this grid
  SheetFamily(const ObjectModel& model, const Eigen::Vector3d& gravity, double cell,
              double simulator_cell, double longest_step, bool given)
      : model_(model),
        gravity_(gravity),
        given_(given),
        scale_(std::pow(simulator_cell / cell, 2)) {
    settings_.cell_size = cell;
    settings_.longest_step = longest_step;
    settings_.coarse_skin = true;
    at(kStiffStart);
    at(0.0);
  }

  bool given() const { return given_; }

  // @param log_stiffness  of the modulus over that which the simulator starts with, on its grid
  SheetSimulation& at(double log_stiffness) {
    return keep(sheet_, log_stiffness, settings_, sheet_.sheet.get());
  }

  // The same by kStiffer stiffer, to tell what stiffness does: so much better settled than that
  // changes the shape.
  const SheetSimulation& stifferThan(double log_stiffness) {
    if (given_) return at(log_stiffness);
    SheetSettings settings = settings_;
    settings.sag *= kStiffer;
    return keep(stiffer_, log_stiffness + kStiffer, settings, &at(log_stiffness));
  }

  double stiffnessOverDensity(double log_stiffness) {
    return at(log_stiffness).stiffnessRatio() / scale_;
  }

 private:
  struct Kept {
    double log_stiffness = 0.0;
    std::unique_ptr<SheetSimulation> sheet;
  };

  SheetSimulation& keep(Kept& kept, double log_stiffness, SheetSettings settings,
                        const SheetSimulation* like) {
    if (given_) log_stiffness = -std::log(scale_);
    if (!kept.sheet || kept.log_stiffness != log_stiffness) {
      settings.stiffness = scale_ * std::exp(log_stiffness);
      kept = {log_stiffness, std::make_unique<SheetSimulation>(model_, gravity_, settings, like)};
    }
    return *kept.sheet;
  }

  const ObjectModel& model_;
  Eigen::Vector3d gravity_;
  bool given_;
  SheetSettings settings_;
  double scale_;  // modulus with which this grid bends as the simulator's does, over the latter's
  Kept sheet_, stiffer_;
};

// The least-squares problem: residuals of the simulated against the observed amplitudes.
class WindFit {
 public:
  WindFit(SheetFamily& sheets, const ObjectModel& model, const std::vector<double>& times,
          const DeformationModes& modes, const Eigen::Vector3d& gravity, const WindParams& params)
      : sheets_(sheets),
        times_(times),
        modes_(modes),
        params_(params),
        down_(gravity.norm() > 0.0 ? Eigen::Vector3d(gravity.normalized())
                                   : Eigen::Vector3d::Zero()) {
    const Eigen::Matrix3d R = model.world_from_object.linear();
    Eigen::MatrixXd shapes(modes.shapes.rows(), modes.count());
    for (int m = 0; m < modes.count(); ++m) {
      const Eigen::Map<const Eigen::Matrix3Xd> shape(modes.shapes.col(m).data(), 3,
                                                     modes.shapes.rows() / 3);
      Eigen::Map<Eigen::Matrix3Xd>(shapes.col(m).data(), 3, shape.cols()) = R * shape;
    }
    measured_ = (shapes.transpose() * shapes).ldlt().solve(shapes.transpose());
    velocities_ = shapes * modes.velocities.row(0).transpose();
    const double motion = std::sqrt(modes.amplitudes.squaredNorm() / modes.amplitudes.rows());
    deviations_ =
        (modes.deviations.array().square() + std::pow(params.model_error * motion, 2)).sqrt();
  }

  // Amplitudes of the modes and, if asked for, how they depend on w: the wind at the knots, one
  // after the other, then log s. Nothing where the sheet is too soft to hang in its shape.
  std::optional<SheetMotion> simulated(const std::vector<double>& knots, const Eigen::VectorXd& w,
                                       bool slopes) const {
    WindCourse course{knots, {}};
    for (size_t i = 0; i < knots.size(); ++i) course.wind.push_back(w.segment<3>(3 * i));
    const double log_stiffness = w[3 * knots.size()];
    try {
      const SheetSimulation* stiffer = slopes ? &sheets_.stifferThan(log_stiffness) : nullptr;
      return sheets_.at(log_stiffness)
          .measure(times_, velocities_, course, measured_, stiffer, kStiffer);
    } catch (const NoEquilibrium&) {
      return std::nullopt;
    }
  }

  struct Linearised {
    Eigen::VectorXd r;  // differences over their deviations, T x K flattened
    Eigen::MatrixXd J;
  };

  Linearised linearise(const SheetMotion& motion) const {
    Linearised at{flat(motion.amplitudes - modes_.amplitudes), {}};
    at.J.resize(at.r.size(), motion.slopes.size());
    for (size_t p = 0; p < motion.slopes.size(); ++p) at.J.col(p) = flat(motion.slopes[p]);
    if (sheets_.given()) at.J.col(at.J.cols() - 1).setZero();
    return at;
  }

  // Information of what is known beforehand: wind is not endless, and changes slowly.
  Eigen::MatrixXd prior(const std::vector<double>& knots) const {
    const int n = static_cast<int>(knots.size());
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(3 * n + 1, 3 * n + 1);
    P(3 * n, 3 * n) = 1.0 / (params_.stiffness * params_.stiffness);
    const double level = 1.0 / (n * params_.strongest * params_.strongest);
    const double upright = 1.0 / (n * params_.rising * params_.rising);
    const Eigen::Matrix3d weight =
        level * Eigen::Matrix3d::Identity() + (upright - level) * down_ * down_.transpose();
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

  struct Fitted {
    Eigen::VectorXd w;
    Eigen::MatrixXd amplitudes;  // T x K, with the w that the steps ended at
    Eigen::MatrixXd information;
    double cost = 0.0, left = 0.0;  // left: the residuals' part
  };

  // Gauss-Newton from `w`. Nothing where the sheet does not hang in its shape there.
  std::optional<Fitted> solve(const std::vector<double>& knots, Eigen::VectorXd w) const {
    const Eigen::MatrixXd P = prior(knots);
    std::optional<SheetMotion> reached = simulated(knots, w, true);
    if (!reached) return std::nullopt;
    Linearised at = linearise(*reached);
    double cost = at.r.squaredNorm() + w.dot(P * w);
    double damping = 0.0;  // after Levenberg and Marquardt
    for (int trial = 0, failed = 0; trial < kTrials && failed < kFailures; ++trial) {
      const Eigen::VectorXd step = stepFrom(at.J, P, at.r, w, damping);
      std::optional<SheetMotion> motion = simulated(knots, w + step, true);
      const double before = cost;
      if (motion) {
        const Eigen::VectorXd tried = w + step;
        const Linearised there = linearise(*motion);
        const double value = there.r.squaredNorm() + tried.dot(P * tried);
        if (value < cost) w = tried, at = there, cost = value, reached.swap(motion);
      }
      if (step.cwiseAbs().maxCoeff() < kSettled ||
          (cost < before && before - cost < kGained * before))
        break;
      failed = cost < before ? 0 : failed + 1;
      damping = cost < before ? (damping < kLeastDamping ? 0.0 : damping / kDamping)
                              : std::max(kLeastDamping, damping * kDamping);
    }
    return Fitted{seenPart(at.J, P, w), reached->amplitudes, at.J.transpose() * at.J + P, cost,
                  at.r.squaredNorm()};
  }

  // Gauss-Newton's step. Where the picture says little more than what was known beforehand, as of
  // wind along the sheet, it would follow the errors of the simulation: there w goes to what was
  // known beforehand.
  Eigen::VectorXd stepFrom(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P,
                           const Eigen::VectorXd& r, const Eigen::VectorXd& w,
                           double damping) const {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> seen(J.transpose() * J, P);
    const Eigen::MatrixXd& V = seen.eigenvectors();  // V' P V = 1
    const Eigen::VectorXd beforehand = V.transpose() * (P * w),
                          pictures = V.transpose() * (J.transpose() * r);
    Eigen::VectorXd along(w.size());
    for (int i = 0; i < w.size(); ++i) {
      const double information = seen.eigenvalues()[i];
      along[i] = information > leastInformation(seen.eigenvalues())
                     ? (pictures[i] + beforehand[i]) / ((1.0 + damping) * information + 1.0)
                     : beforehand[i];
    }
    return -(V * along);
  }

  // Wind and log s. A stiff sheet in much wind and a soft one in little are two valleys: the better
  // of both ends. Where neither shows the motion, it is for a changing wind to do, on the stiff
  // one, which answers it more evenly.
  // @param direction  unit vector, of the wind that is tried first
  std::optional<Fitted> steady(const Eigen::Vector3d& direction) const {
    const double motion = flat(modes_.amplitudes).squaredNorm();
    std::optional<Fitted> best;
    for (const double log_stiffness : {0.0, kStiffStart}) {
      const std::optional<Fitted> fitted =
          solve({times_.front()}, firstGuess(direction, log_stiffness));
      if (!fitted) continue;
      const bool none_shown = best && fitted->left > (1.0 - kHardlyShown) * motion &&
                              best->left > (1.0 - kHardlyShown) * motion;
      if (!best || fitted->cost < best->cost || none_shown) best = fitted;
      if (fitted->left < (1.0 - kWellShown) * motion || sheets_.given()) break;
    }
    return best;
  }

  // The strength in `direction` that shows most.
  Eigen::VectorXd firstGuess(const Eigen::Vector3d& direction, double log_stiffness) const {
    Eigen::VectorXd best(4);
    double least = std::numeric_limits<double>::infinity();
    for (const double strength : kGuesses) {
      Eigen::VectorXd w(4);
      w << strength * direction, log_stiffness;
      const std::optional<SheetMotion> motion = simulated({times_.front()}, w, false);
      const double left =
          motion ? flat(motion->amplitudes - modes_.amplitudes).squaredNorm() : least;
      if (strength > kGuesses[0] && left >= least) break;
      best = w, least = left;
    }
    return best;
  }

  // w, as it was known beforehand where the pictures say no more.
  Eigen::VectorXd seenPart(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P,
                           const Eigen::VectorXd& w) const {
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> seen(J.transpose() * J, P);
    const Eigen::MatrixXd& V = seen.eigenvectors();
    const Eigen::VectorXd along =
        (seen.eigenvalues().array() > leastInformation(seen.eigenvalues()))
            .select(V.transpose() * (P * w), 0.0);
    return V * along;
  }

  // What the simulation cannot show persists from frame to frame, and would otherwise outvote what
  // is known beforehand: from here on residuals count as the fewer independent ones that they are.
  void allowForPersistence(const Eigen::MatrixXd& amplitudes) {
    const Eigen::VectorXd r = flat(amplitudes - modes_.amplitudes);
    const int frames = static_cast<int>(times_.size());
    double square = 0.0, product = 0.0;
    for (int m = 0; m < modes_.count(); ++m) {
      const auto series = r.segment(m * frames, frames);
      square += series.squaredNorm();
      product += series.tail(frames - 1).dot(series.head(frames - 1));
    }
    const double correlation =
        square > 0.0 ? std::clamp(product / square, 0.0, kMostPersistent) : 0.0;
    spread_ *=
        std::sqrt(std::max(1.0, square / r.size()) * (1.0 + correlation) / (1.0 - correlation));
  }

 private:
  // Over the deviations.
  Eigen::VectorXd flat(const Eigen::MatrixXd& amplitudes) const {
    const Eigen::MatrixXd scaled = (amplitudes.array() / (spread_ * deviations_.array())).matrix();
    return Eigen::Map<const Eigen::VectorXd>(scaled.data(), scaled.size());
  }

  double leastInformation(const Eigen::VectorXd& information) const {
    return sheets_.given() ? -1.0 : std::min(kSeen, kSeenShare * information.maxCoeff());
  }

  SheetFamily& sheets_;
  const std::vector<double>& times_;
  const DeformationModes& modes_;
  const WindParams& params_;
  Eigen::Vector3d down_;        // unit; zero without gravity
  Eigen::MatrixXd measured_;    // Phi^+, K x 3 #V, world axes
  Eigen::VectorXd velocities_;  // of the surface in the key frame
  Eigen::MatrixXd deviations_;  // T x K
  double spread_ = 1.0;         // factor on them
};

// Unit vector across the sheet, towards the side to which it moves: what pushes it must come from
// the other one.
Eigen::Vector3d likelyDirection(const ObjectModel& model, const DeformationModes& modes) {
  const Eigen::VectorXd shape = modes.shapes * modes.amplitudes.colwise().mean().transpose();
  const Eigen::Map<const Eigen::Matrix3Xd> u(shape.data(), 3, shape.size() / 3);
  const Eigen::Vector3d mean = model.world_from_object.linear() * u.rowwise().mean();
  return mean.norm() > 0.0 ? Eigen::Vector3d(mean.normalized()) : Eigen::Vector3d::Zero();
}

// Edges of the cubes that are tried first, and of the simulator's, m.
struct CellSizes {
  double first, simulator;
};

// On as coarse a grid as finds an equilibrium. A sheet of unknown stiffness must also hang in its
// shape when it is soft; where it does not, finer grids hardly help, and would cost most of the
// time. @param note  why there is none
std::optional<SheetFamily> sheetsOf(const ObjectModel& model, const Eigen::Vector3d& gravity,
                                    const CellSizes& cells, bool given, std::string& note,
                                    const WindParams& params) {
  std::optional<SheetFamily> sheets;
  double cell = cells.first;
  for (int finer = 1; !sheets && finer <= (given ? kFiner : 1); finer *= 2) {
    if (finer > 1) cell = cellSizeFor(model.mesh, finer * params.nodes);
    try {
      sheets.emplace(model, gravity, cell, cells.simulator, params.longest_step, given);
      note.clear();
    } catch (const NoEquilibrium& error) {
      note = std::string("no wind: ") + error.what();
    }
  }
  return sheets;
}

// @param given  the sheet is as stiff as the simulator starts with; else that is fitted, too
std::optional<WindEstimate> fitWind(const ObjectModel& model, const std::vector<double>& times,
                                    const DeformationModes& modes, const Eigen::Vector3d& gravity,
                                    const CellSizes& cells, bool given, std::string& note,
                                    const WindParams& params) {
  std::optional<SheetFamily> sheets = sheetsOf(model, gravity, cells, given, note, params);
  if (!sheets) return std::nullopt;
  WindFit fit(*sheets, model, times, modes, gravity, params);
  // A steady wind first, then a changing one from there.
  const std::optional<WindFit::Fitted> steady = fit.steady(likelyDirection(model, modes));
  if (!steady) {
    note = kNoEquilibrium;
    return std::nullopt;
  }
  fit.allowForPersistence(steady->amplitudes);
  WindEstimate estimate;
  estimate.knots = knotsOver(times.front(), times.back(), params.knot_spacing);
  const int count = static_cast<int>(estimate.knots.size());
  Eigen::VectorXd changing(3 * count + 1);
  for (int i = 0; i < count; ++i) changing.segment<3>(3 * i) = steady->w.head<3>();
  changing[3 * count] = steady->w[3];
  const std::optional<WindFit::Fitted> fitted = fit.solve(estimate.knots, changing);
  if (!fitted) {
    note = kNoEquilibrium;
    return std::nullopt;
  }
  changing = fitted->w;
  const Eigen::MatrixXd covariance =
      fitted->information.ldlt().solve(Eigen::MatrixXd::Identity(3 * count + 1, 3 * count + 1));
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
  estimate.amplitudes = fit.simulated(estimate.knots, changing, false)->amplitudes;
  estimate.explained =
      1.0 - (estimate.amplitudes - modes.amplitudes).squaredNorm() / modes.amplitudes.squaredNorm();
  if (estimate.explained < params.least_explained) {
    char text[160];
    std::snprintf(
        text, sizeof text,
        "no wind: the simulated sheet shows %.0f %% of the motion at best; another material "
        "or hold may",
        100.0 * std::max(0.0, estimate.explained));
    note = text;
    return std::nullopt;
  }
  return estimate;
}

}  // namespace

Eigen::Matrix3d WindEstimate::covarianceAt(double time) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < knots.size(); ++i) sum += weight(i, time) * covariance[i];
  return sum;
}

// A motion that no hanging sheet makes, such as a wave that something else drives, may lead
// stiffness and wind together astray: then the wind alone is fitted as well, and what shows more of
// the motion is taken.
std::optional<WindEstimate> estimateWind(const ObjectModel& model, const std::vector<double>& times,
                                         const DeformationModes& modes,
                                         const Eigen::Vector3d& gravity, std::string& note,
                                         const WindParams& params) {
  if (modes.count() == 0 || times.size() < 3) return std::nullopt;
  try {
    const CellSizes cells{cellSizeFor(model.mesh, params.nodes),
                          cellSizeFor(model.mesh, params.simulator_nodes)};
    const auto free = fitWind(model, times, modes, gravity, cells, false, note, params);
    if (free && free->explained > kWellShown) return free;
    const auto given = fitWind(model, times, modes, gravity, cells, true, note, params);
    if (free || given) note.clear();
    return !given || (free && free->explained > given->explained) ? free : given;
  } catch (const std::invalid_argument& error) {  // a mesh that the simulator refuses
    note = std::string("no wind: ") + error.what();
    return std::nullopt;
  }
}

}  // namespace calipso::flow
