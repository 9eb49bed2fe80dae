#include "calipso_flow/wind_estimate.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "wind_fit.hpp"

namespace calipso::flow {
namespace {

constexpr int kFiner = 4;  // times the nodes at most
constexpr char kNoEquilibrium[] =
    "no wind: the sheet finds no equilibrium in its shape; see where it is held";

std::vector<double> knotsOver(double begin, double end, double spacing) {
  const int intervals = std::max(1, static_cast<int>(std::lround((end - begin) / spacing)));
  std::vector<double> knots;
  for (int i = 0; i <= intervals; ++i) knots.push_back(begin + (end - begin) * i / intervals);
  return knots;
}

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
// time.
// @param note  why there is none
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

// A steady wind first, then from there one that changes between the knots.
std::optional<WindFit::Fitted> steadyThenChanging(WindFit& fit, const ObjectModel& model,
                                                  const DeformationModes& modes,
                                                  const std::vector<double>& knots) {
  const std::optional<WindFit::Fitted> steady = fit.steady(likelyDirection(model, modes));
  if (!steady) return std::nullopt;
  fit.allowForPersistence(steady->amplitudes);
  Eigen::VectorXd w(3 * knots.size() + 1);
  w << steady->w.head<3>().replicate(knots.size(), 1), steady->w[3];
  return fit.solve(knots, w);
}

// What the fitted unknowns and their covariance say, at the knots and over the clip.
WindEstimate estimateFrom(const WindFit::Fitted& fitted, const std::vector<double>& knots,
                          SheetFamily& sheets) {
  WindEstimate estimate;
  estimate.knots = knots;
  const int count = static_cast<int>(knots.size()), unknowns = 3 * count + 1;
  const Eigen::MatrixXd covariance =
      fitted.information.ldlt().solve(Eigen::MatrixXd::Identity(unknowns, unknowns));
  Eigen::MatrixXd average = Eigen::MatrixXd::Zero(3, unknowns);
  for (int i = 0; i < count; ++i) {
    estimate.wind.push_back(fitted.w.segment<3>(3 * i));
    estimate.covariance.push_back(covariance.block<3, 3>(3 * i, 3 * i));
    const double weight = (i == 0 || i + 1 == count ? 0.5 : 1.0) / (count - 1);
    average.block<3, 3>(0, 3 * i) = weight * Eigen::Matrix3d::Identity();
  }
  estimate.mean = average * fitted.w;
  estimate.mean_covariance = average * covariance * average.transpose();
  if (sheets.given()) return estimate;
  estimate.stiffness_over_density = sheets.stiffnessOverDensity(fitted.w[3 * count]);
  estimate.stiffness_over_density_deviation =
      estimate.stiffness_over_density * std::sqrt(covariance(3 * count, 3 * count));
  return estimate;
}

// @param given  the sheet is as stiff as the simulator starts with; else that is fitted, too
std::optional<WindEstimate> fitWind(const ObjectModel& model, const std::vector<double>& times,
                                    const DeformationModes& modes, const Eigen::Vector3d& gravity,
                                    const CellSizes& cells, bool given, std::string& note,
                                    const WindParams& params) {
  std::optional<SheetFamily> sheets = sheetsOf(model, gravity, cells, given, note, params);
  if (!sheets) return std::nullopt;
  WindFit fit(*sheets, model, times, modes, gravity, params);
  const std::vector<double> knots = knotsOver(times.front(), times.back(), params.knot_spacing);
  const std::optional<WindFit::Fitted> fitted = steadyThenChanging(fit, model, modes, knots);
  if (!fitted) {
    note = kNoEquilibrium;
    return std::nullopt;
  }
  WindEstimate estimate = estimateFrom(*fitted, knots, *sheets);
  estimate.amplitudes =
      fitted->all_seen ? fitted->amplitudes : fit.simulated(knots, fitted->w, false)->amplitudes;
  estimate.explained =
      1.0 - (estimate.amplitudes - modes.amplitudes).squaredNorm() / modes.amplitudes.squaredNorm();
  if (estimate.explained >= params.least_explained) return estimate;
  note = "no wind: the simulated sheet shows " +
         std::to_string(std::lround(100.0 * std::max(0.0, estimate.explained))) +
         " % of the motion at best; another material or hold may";
  return std::nullopt;
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
