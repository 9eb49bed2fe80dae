#include "motion_errors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Frames over which the true motion is smooth: up to the first collision, or all.
size_t smoothFrames(const TrueObject& truth, const ObjectDynamics& dynamics) {
  if (truth.collisions.empty()) return dynamics.motions.size();
  size_t k = 0;
  while (k < dynamics.observations.size() &&
         dynamics.observations[k].time < truth.collisions.front().time) {
    ++k;
  }
  return k;
}

struct MotionErrors {
  double velocity_m = kNone, velocity_deviation_m = kNone, velocity_percent = kNone,
         velocity_px = kNone;
  double spin_percent = kNone, acceleration_percent = kNone;
  double covered = kNone;  // share of frames whose velocity lies inside its 95 % ellipsoid
  bool below_uncertainty = true;
};

// 95 % of a chi-squared variable with three degrees of freedom lie below this.
constexpr double kChiSquared95 = 7.815;

MotionErrors motionErrors(const Scene& scene, const TrueObject& truth,
                          const ObjectDynamics& dynamics) {
  MotionErrors errors;
  if (!truth.hasVelocity()) return errors;
  const size_t frames = smoothFrames(truth, dynamics);
  double error = 0.0, variance = 0.0, speed = 0.0, spin_error = 0.0, spin = 0.0, pixels = 0.0;
  int inside = 0;
  for (size_t k = 0; k < frames; ++k) {
    const ObjectMotion& motion = dynamics.motions[k];
    const Eigen::Vector3d v =
        truth.velocity.empty() ? Eigen::Vector3d::Zero() : valueAt(truth.velocity, k);
    const Eigen::Vector3d w = truth.spin.empty() ? Eigen::Vector3d::Zero() : valueAt(truth.spin, k);
    const Eigen::Vector3d difference = motion.state.velocity - v;
    const double depth = (scene.camera.world_from_camera.inverse() * motion.state.position).z();
    error += difference.squaredNorm();
    speed += v.squaredNorm();
    pixels += difference.norm() * scene.camera.fx / depth / scene.fps;
    spin_error += (motion.state.spin - w).squaredNorm();
    spin += w.squaredNorm();
    const Eigen::Matrix3d covariance = motion.state.twistCovariance().topLeftCorner<3, 3>();
    variance += covariance.trace();
    const bool covers = difference.dot(covariance.ldlt().solve(difference)) < kChiSquared95;
    inside += covers;
    if (truth.still() && !covers) errors.below_uncertainty = false;
  }
  errors.velocity_m = std::sqrt(error / frames);
  errors.velocity_deviation_m = std::sqrt(variance / frames);
  errors.velocity_px = pixels / frames;
  errors.covered = static_cast<double>(inside) / frames;
  if (speed > 0.0) errors.velocity_percent = 100.0 * std::sqrt(error / speed);
  if (spin > 0.0) errors.spin_percent = 100.0 * std::sqrt(spin_error / spin);
  return errors;
}

// Per true collision the distance to the nearest estimated one, in frames; null when there is none.
std::vector<double> collisionErrors(const Scene& scene, const TrueObject& truth,
                                    const Trajectory& trajectory) {
  std::vector<double> errors;
  for (const TrueCollision& collision : truth.collisions) {
    double nearest = kNone;
    for (const Collision& found : trajectory.collisions) {
      const double error = scene.fps * (found.time - collision.time);
      if (std::isnan(nearest) || std::abs(error) < std::abs(nearest)) nearest = error;
    }
    errors.push_back(nearest);
  }
  return errors;
}

// Impacts of which no frame lies between two are one, told at any instant from its first to its
// last, or within a frame of these.
struct ImpactCount {
  int present = 0, found = 0;
  int wrong = 0;  // told where there is none
};

ImpactCount countImpacts(const Scene& scene, const TrueObject& truth,
                         const Trajectory& trajectory) {
  struct Impact {
    double first, last;  // frames
    bool found = false;
  };
  std::vector<Impact> impacts;
  for (const TrueCollision& collision : truth.collisions) {
    const double at = scene.fps * collision.time;
    if (impacts.empty() || at - impacts.back().last >= 1.0) impacts.push_back({at, at});
    impacts.back().last = at;
  }
  ImpactCount count;
  for (const Collision& told : trajectory.collisions) {
    const double at = scene.fps * told.time;
    const auto met = std::find_if(impacts.begin(), impacts.end(), [&](const Impact& impact) {
      return at > impact.first - 1.0 && at < impact.last + 1.0;
    });
    if (met == impacts.end()) {
      ++count.wrong;
    } else {
      met->found = true;
    }
  }
  count.present = static_cast<int>(impacts.size());
  count.found = static_cast<int>(
      std::count_if(impacts.begin(), impacts.end(), [](const Impact& i) { return i.found; }));
  return count;
}

// Vertical, of the first impact; true impacts less than a frame apart, which no frame lies between,
// count as one.
double restitutionError(const Scene& scene, const TrueObject& truth, const Trajectory& trajectory) {
  if (truth.collisions.empty() || trajectory.collisions.empty()) return kNone;
  const Eigen::Vector3d up = -scene.gravity.normalized();
  const TrueCollision& t = truth.collisions.front();
  const TrueCollision* last = &t;
  for (const TrueCollision& next : truth.collisions) {
    if (next.time - last->time < 1.0 / scene.fps) last = &next;
  }
  const Collision& e = trajectory.collisions.front();
  const double real = -last->velocity_after.dot(up) / t.velocity_before.dot(up);
  const double found = -e.after.velocity.dot(up) / e.before.velocity.dot(up);
  return 100.0 * std::abs(found / real - 1.0);
}

// Of the first impact, along the change of velocity, in units of its stated deviation.
double restitutionSurprise(const Scene& scene, const TrueObject& truth,
                           const Trajectory& trajectory) {
  if (truth.collisions.empty() || trajectory.collisions.empty()) return kNone;
  const TrueCollision& t = truth.collisions.front();
  const Collision& e = trajectory.collisions.front();
  if (std::abs(e.time - t.time) > 1.0 / scene.fps) return kNone;
  Collision real;
  real.before.velocity = t.velocity_before;
  for (const TrueCollision& next : truth.collisions) {
    if (next.time - t.time < 1.0 / scene.fps) real.after.velocity = next.velocity_after;
  }
  return (e.restitution() - real.restitution()) / e.restitutionDeviation();
}

// The paper's cue: the first frame at which the flow along gravity changes its sign, half a frame
// earlier. Error in frames against the first true collision.
double signChangeError(const Scene& scene, const TrueObject& truth,
                       const ObjectDynamics& dynamics) {
  if (truth.collisions.empty()) return kNone;
  const auto position = [&](size_t k) {
    const Observation& o = dynamics.observations[k];
    return o.world_from_object.translation().dot(scene.gravity.normalized());
  };
  for (size_t k = 2; k < dynamics.observations.size(); ++k) {
    const double before = position(k - 1) - position(k - 2), now = position(k) - position(k - 1);
    if (before <= 0.0 || now >= 0.0) continue;
    return k - 0.5 - scene.fps * truth.collisions.front().time;
  }
  return kNone;
}

double gravityError(const Scene& scene, const Trajectory& trajectory) {
  if (!trajectory.gravity) return kNone;
  return 100.0 * std::abs(trajectory.gravity->acceleration.norm() / scene.gravity.norm() - 1.0);
}

}  // namespace

const Eigen::Vector3d& valueAt(const std::vector<Eigen::Vector3d>& values, size_t k) {
  return values[std::min(k, values.size() - 1)];
}

void addMotionErrors(const Scene& scene, const TrueObject& truth, const ObjectDynamics& dynamics,
                     JsonEntry& entry) {
  const MotionErrors errors = motionErrors(scene, truth, dynamics);
  const Trajectory& trajectory = dynamics.trajectory;
  entry.number("velocity_error_percent", errors.velocity_percent);
  entry.number("velocity_error_px", errors.velocity_px);
  entry.number("velocity_error_m_s", errors.velocity_m);
  entry.number("velocity_deviation_m_s", errors.velocity_deviation_m);
  entry.number("angular_velocity_error_percent", errors.spin_percent);
  entry.number("g_error_percent", gravityError(scene, trajectory));
  entry.numbers("collision_errors_frames", collisionErrors(scene, truth, trajectory));
  entry.number("collisions_found", static_cast<double>(trajectory.collisions.size()));
  const ImpactCount impacts = countImpacts(scene, truth, trajectory);
  const auto told = [&](int count) { return truth.collisions_known ? count : kNone; };
  entry.number("impacts_present", told(impacts.present));
  entry.number("impacts_found", told(impacts.found)).number("impacts_false", told(impacts.wrong));
  entry.number("sign_change_error_frames", signChangeError(scene, truth, dynamics));
  entry.number("restitution_error_percent", restitutionError(scene, truth, trajectory));
  entry.number("restitution_error_deviations", restitutionSurprise(scene, truth, trajectory));
  entry.number("covered_95", errors.covered);
  if (truth.still()) entry.flag("below_uncertainty", errors.below_uncertainty);
}

}  // namespace calipso::flow
