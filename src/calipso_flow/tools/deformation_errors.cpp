#include "deformation_errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoPi = 6.28318530717958647692;

double percent(double estimate, double truth) {
  return 100.0 * std::abs(estimate / truth - 1.0);
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

}  // namespace

void addDeformationErrors(const ObjectModel& model, const TrueObject& truth, const ObjectDynamics& dynamics,
                          JsonEntry& entry) {
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
        travel = 360.0 / kTwoPi *
                 std::acos(std::clamp(k.normalized().dot(truth.wave->vector.normalized()), -1.0, 1.0));
      }
    }
    if (truth.vertices.size() == motion.times.size()) {
      shape = shapeError(model, truth, motion.modes);
    }
  }
  entry.flag("deforms", dynamics.deformation.has_value());
  entry.number("frequency_error_percent", frequency);
  entry.number("frequency_hz", estimate).number("frequency_deviation_hz", deviation);
  entry.number("travel_direction_error_deg", travel).number("lean_error_percent", lean);
  entry.number("shape_error_percent", shape);
  // The wind is not estimated.
  entry.null("wind_direction_error_deg").null("wind_strength_error_percent");
}

}  // namespace calipso::flow
