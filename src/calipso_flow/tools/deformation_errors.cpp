#include "deformation_errors.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoPi = 6.28318530717958647692;
constexpr double kLowerEdge = 0.05;  // of the height

double percent(double estimate, double truth) {
  return 100.0 * std::abs(estimate / truth - 1.0);
}

// The lower edge's mean way out of the sheet, over time.
Eigen::VectorXd lowerEdgeTrack(const std::vector<Eigen::MatrixXd>& surfaces,
                               const std::vector<int>& edge, const Eigen::Vector3d& normal) {
  Eigen::VectorXd track(surfaces.size());
  for (size_t k = 0; k < surfaces.size(); ++k) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const int i : edge) sum += surfaces[k].row(i).transpose();
    track[k] = sum.dot(normal) / static_cast<double>(edge.size());
  }
  return track;
}

double correlation(Eigen::VectorXd a, Eigen::VectorXd b) {
  a.array() -= a.mean();
  b.array() -= b.mean();
  return a.dot(b) / std::max(1e-300, a.norm() * b.norm());
}

// Root mean square error of the vertices over that of their true motion.
double shapeError(const ObjectModel& model, const TrueObject& truth, const DeformationModes& modes) {
  double error = 0.0, motion = 0.0;
  for (int k = 0; k < modes.amplitudes.rows(); ++k) {
    const auto moved = modes.surface(model.mesh, modes.amplitudes.row(k).transpose());
    const Eigen::MatrixXd true_motion = truth.vertices[k] - truth.vertices[0];
    error += (moved - model.mesh.vertices - true_motion).squaredNorm();
    motion += true_motion.squaredNorm();
  }
  return 100.0 * std::sqrt(error / motion);
}

// How well the cloth, simulated in the estimated wind, moves as the true one.
double clothCorrelation(const ObjectModel& model, const Eigen::Vector3d& gravity,
                        const TrueObject& truth, const DeformationMotion& motion) {
  const Eigen::VectorXd height = -(truth.vertices[0] * gravity.normalized());
  const double low = height.minCoeff(), limit = low + kLowerEdge * (height.maxCoeff() - low);
  std::vector<int> edge;
  for (int i = 0; i < height.size(); ++i) {
    if (height[i] < limit) edge.push_back(i);
  }
  ClothSimulation simulation(model, gravity);
  const auto wind = [&](double time) {
    const auto after = std::lower_bound(motion.times.begin(), motion.times.end(), time);
    const size_t k = std::min<size_t>(after - motion.times.begin(), motion.times.size() - 1);
    return motion.wind->velocity[k];
  };
  const Eigen::VectorXd v = motion.modes.shapes * motion.modes.velocities.row(0).transpose();
  const ClothSimulation::Vertices velocity =
      Eigen::Map<const ClothSimulation::Vertices>(v.data(), v.size() / 3, 3) *
      model.world_from_object.linear().transpose();
  std::vector<Eigen::MatrixXd> simulated;
  for (const auto& surface : simulation.run(motion.times, wind, velocity)) {
    simulated.push_back(surface);
  }
  // The direction in which the true edge moves most.
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (const Eigen::MatrixXd& shape : truth.vertices) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const int i : edge) mean += (shape.row(i) - truth.vertices[0].row(i)).transpose();
    moment += mean * mean.transpose();
  }
  const Eigen::Vector3d along =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moment).eigenvectors().col(2);
  return correlation(lowerEdgeTrack(simulated, edge, model.world_from_object.linear() * along),
                     lowerEdgeTrack(truth.vertices, edge, along));
}

}  // namespace

void addDeformationErrors(const ObjectModel& model, const Eigen::Vector3d& gravity,
                          const TrueObject& truth, const ObjectDynamics& dynamics,
                          JsonEntry& entry) {
  double frequency = kNone, travel = kNone, lean = kNone, shape = kNone, cloth = kNone,
         explained = kNone, estimate = kNone, deviation = kNone;
  std::vector<double> wind;
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
        travel = 360.0 / kTwoPi *
                 std::acos(std::clamp(k.normalized().dot(truth.wave->vector.normalized()), -1.0, 1.0));
      }
    }
    if (truth.vertices.size() == motion.times.size()) {
      shape = shapeError(model, truth, motion.modes);
      if (motion.wind) cloth = clothCorrelation(model, gravity, truth, motion);
    }
    if (motion.wind) {
      explained = motion.wind->explained;
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (const Eigen::Vector3d& w : motion.wind->velocity) mean += w;
      mean /= static_cast<double>(motion.wind->velocity.size());
      wind = {mean.x(), mean.y(), mean.z()};
    }
  }
  entry.flag("deforms", dynamics.deformation.has_value());
  entry.number("frequency_error_percent", frequency);
  entry.number("frequency_hz", estimate).number("frequency_deviation_hz", deviation);
  entry.number("travel_direction_error_deg", travel).number("lean_error_percent", lean);
  entry.number("shape_error_percent", shape).number("cloth_correlation", cloth);
  entry.numbers("mean_wind_m_s", wind).number("wind_explained", explained);
  // No scene folder states the wind that blew; the cloth filmed in a known wind is a test.
  entry.null("wind_direction_error_deg").null("wind_strength_error_percent");
}

}  // namespace calipso::flow
