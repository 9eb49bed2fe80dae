#include "calipso_flow/trajectory.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "trajectory_fitter.hpp"

namespace calipso::flow {
namespace {

void checkTimes(const std::vector<PoseMeasurement>& measurements) {
  bool any = false;
  for (size_t k = 0; k < measurements.size(); ++k) {
    any = any || measurements[k].valid;
    if (k > 0 && !(measurements[k].time > measurements[k - 1].time)) {
      throw std::invalid_argument(
          "trajectory: measurement " + std::to_string(k) + " at " +
          std::to_string(measurements[k].time) + " s is not later than the one before (" +
          std::to_string(measurements[k - 1].time) + " s); give them in order of time");
    }
  }
  if (!any) throw std::invalid_argument("trajectory: no frame has a measured pose");
}

}  // namespace

double Collision::restitution() const {
  constexpr double kLeastApproach = 0.01;  // of the change of velocity
  const Eigen::Vector3d change = after.velocity - before.velocity, normal = change.normalized();
  const double approach = -before.velocity.dot(normal);
  if (std::abs(approach) < kLeastApproach * change.norm())
    return std::numeric_limits<double>::quiet_NaN();
  return after.velocity.dot(normal) / approach;
}

// e = -(a . d) / (b . d) of the velocities b before and a after, d = a - b:
//   de/da = -(d + a + e b) / (b . d),  de/db = (a - e (d - b)) / (b . d);
// what the instant is off by, both fall longer or shorter.
double Collision::restitutionDeviation() const {
  const Eigen::Vector3d &a = after.velocity, &b = before.velocity, d = a - b;
  const double e = restitution(), over = b.dot(d);
  const Eigen::Vector3d by_after = -(d + a + e * b) / over, by_before = (a - e * (d - b)) / over;
  const double by_time = by_after.dot(after.acceleration) + by_before.dot(before.acceleration);
  const auto variance = [](const Eigen::Vector3d& slope, const MotionState& state) {
    return slope.dot(state.twistCovariance().topLeftCorner<3, 3>() * slope);
  };
  return std::sqrt(variance(by_after, after) + variance(by_before, before) +
                   std::pow(by_time * time_deviation, 2));
}

const MotionPiece& Trajectory::pieceAt(double time) const {
  size_t i = 0;
  while (i + 1 < pieces.size() && pieces[i + 1].start <= time) ++i;
  return pieces[i];
}

bool Trajectory::movingAt(double time) const {
  const MotionPiece& piece = pieceAt(time);
  return piece.travel != Travel::kRest || piece.turning != Turning::kNone;
}

Trajectory fitTrajectory(const std::vector<PoseMeasurement>& measurements,
                         const std::vector<double>& cut_times, const MotionPrior& prior,
                         const TrajectoryParams& params) {
  checkTimes(measurements);
  return TrajectoryFitter(measurements, prior, params).run(cut_times);
}

}  // namespace calipso::flow
