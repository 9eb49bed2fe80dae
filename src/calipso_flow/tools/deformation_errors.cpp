#include "deformation_errors.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "calipso_flow/shading.hpp"

namespace calipso::flow {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoPi = 6.28318530717958647692;
constexpr double kMostTrueWaves = 4.0;  // over the object's size

double percent(double estimate, double truth) { return 100.0 * std::abs(estimate / truth - 1.0); }

// Root mean square error of the vertices over that of their true motion.
double shapeError(const ObjectModel& model, const TrueObject& truth,
                  const DeformationModes& modes) {
  double error = 0.0, motion = 0.0;
  for (int k = 0; k < modes.amplitudes.rows(); ++k) {
    const auto moved = modes.surface(model.mesh, modes.amplitudes.row(k).transpose());
    const Eigen::MatrixXd true_motion = truth.vertices[k] - truth.vertices[0];
    error += (moved - model.mesh.vertices - true_motion).squaredNorm();
    motion += true_motion.squaredNorm();
  }
  return 100.0 * std::sqrt(error / motion);
}

// Correlation of the way of the lower edge (within 5 % of the height) with that of the sheet
// simulated in the estimated wind, over frames and axes.
double edgeCorrelation(const ObjectModel& model, const TrueObject& truth,
                       const Eigen::Vector3d& gravity, const DeformationMotion& motion) {
  const Eigen::Vector3d down = model.world_from_object.linear().transpose() * gravity.normalized();
  const Eigen::VectorXd depth = model.mesh.vertices * down;
  const double edge = depth.maxCoeff() - 0.05 * (depth.maxCoeff() - depth.minCoeff());
  Eigen::MatrixXd simulated = Eigen::MatrixXd::Zero(motion.times.size(), 3), real = simulated;
  for (size_t k = 0; k < motion.times.size(); ++k) {
    const auto moved = motion.modes.surface(model.mesh, motion.wind->amplitudes.row(k).transpose());
    for (int i = 0; i < depth.size(); ++i) {
      if (depth[i] < edge) continue;
      simulated.row(k) += moved.row(i) - model.mesh.vertices.row(i);
      real.row(k) += truth.vertices[k].row(i) - truth.vertices[0].row(i);
    }
  }
  simulated.rowwise() -= simulated.colwise().mean().eval();
  real.rowwise() -= real.colwise().mean().eval();
  return (simulated.array() * real.array()).sum() / (simulated.norm() * real.norm());
}

// Which way the true crests go, object frame: the peak of the spatial spectrum that the true
// displacement has at the wave's frequency. What a scene writes of its wave depends on how it
// counts depth.
Eigen::Vector3d trueTravel(const ObjectModel& model, const TrueObject& truth,
                           const std::vector<double>& times) {
  const Eigen::MatrixXd& rest = truth.vertices.front();
  Eigen::MatrixXd basis(times.size(), 3), displacement(times.size(), rest.size());
  for (size_t k = 0; k < times.size(); ++k) {
    const double phase = truth.wave->omega * times[k];
    basis.row(k) << 1.0, std::cos(phase), std::sin(phase);
    const Eigen::MatrixXd moved = truth.vertices[k] - rest;
    displacement.row(k) = Eigen::Map<const Eigen::RowVectorXd>(moved.data(), moved.size());
  }
  const Eigen::MatrixXd c = basis.householderQr().solve(displacement);
  const Eigen::VectorXcd amplitude =
      c.row(1).transpose().cast<std::complex<double>>() -
      std::complex<double>(0.0, 1.0) * c.row(2).transpose().cast<std::complex<double>>();
  const Eigen::Map<const Eigen::MatrixXcd> columns(amplitude.data(), rest.rows(), 3);
  Eigen::Index across = 0;  // the axis along which most of it goes
  columns.colwise().squaredNorm().maxCoeff(&across);
  const Eigen::Index a = (across + 1) % 3, b = (across + 2) % 3;
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(rest.rows(), 2);
  points << rest.col(a), rest.col(b);
  const double farthest = kMostTrueWaves * kTwoPi / boundingDiagonal(model.mesh);
  const Eigen::Vector2d k = planeWaveIn(points, columns.col(across), farthest).wave_vector;
  Eigen::Vector3d travel = Eigen::Vector3d::Zero();
  travel[a] = k.x(), travel[b] = k.y();
  return travel;
}

}  // namespace

void addDeformationErrors(const ObjectModel& model, const TrueObject& truth,
                          const ObjectDynamics& dynamics, const Eigen::Vector3d& gravity,
                          JsonEntry& entry) {
  double edge = kNone, explained = kNone;
  double frequency = kNone, travel = kNone, lean = kNone, shape = kNone, estimate = kNone,
         deviation = kNone;
  if (dynamics.deformation) {
    const DeformationMotion& motion = *dynamics.deformation;
    if (!motion.lines.empty()) {
      estimate = motion.lines[0].line.frequency;
      deviation = motion.lines[0].line.deviation;
    }
    if (truth.wave) {
      frequency = motion.lines.empty() ? kNone : percent(kTwoPi * estimate, truth.wave->omega);
      lean = percent(motion.lean.norm(), truth.wave->lean);
      if (!motion.lines.empty() && !motion.lines[0].wave_vector.isZero()) {
        const Eigen::Vector3d k =
            model.world_from_object.linear().transpose() * motion.lines[0].wave_vector;
        const Eigen::Vector3d truly = truth.vertices.size() == motion.times.size()
                                          ? trueTravel(model, truth, motion.times)
                                          : truth.wave->vector;
        travel = 360.0 / kTwoPi *
                 std::acos(std::clamp(k.normalized().dot(truly.normalized()), -1.0, 1.0));
      }
    }
    if (truth.vertices.size() == motion.times.size()) {
      shape = shapeError(model, truth, motion.modes);
      if (motion.wind) edge = edgeCorrelation(model, truth, gravity, motion);
    }
  }
  entry.flag("deforms", dynamics.deformation.has_value());
  entry.number("frequency_error_percent", frequency);
  entry.number("frequency_hz", estimate).number("frequency_deviation_hz", deviation);
  std::vector<double> lines;
  if (dynamics.deformation) {
    for (const SurfaceLine& line : dynamics.deformation->lines)
      lines.push_back(line.line.frequency);
  }
  entry.numbers("lines_hz", lines);
  entry.number("travel_direction_error_deg", travel).number("lean_error_percent", lean);
  entry.number("shape_error_percent", shape);
  // A scene's wind is only nominal.
  entry.null("wind_direction_error_deg").null("wind_strength_error_percent");
  if (dynamics.deformation && dynamics.deformation->wind) {
    const WindEstimate& wind = *dynamics.deformation->wind;
    entry.numbers("wind_m_s", {wind.mean.x(), wind.mean.y(), wind.mean.z()});
    explained = wind.explained;
  }
  entry.number("wind_explained", explained).number("lower_edge_correlation", edge);
  if (dynamics.deformation) entry.text("note", dynamics.deformation->note);
}

}  // namespace calipso::flow
