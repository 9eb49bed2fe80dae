#include "support_contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calipso_flow/rotation.hpp"

namespace calipso::flow {
namespace {

constexpr double kShapeError = 0.01;  // of the diagonal: so well the lowest point is known
constexpr double kDeviations = 2.0;   // of a pose: so far off it is taken for clear
// log odds, per frame without anything that could hold it, of falling against being held
constexpr double kFalls = 1.5;
// log odds, besides the usual, of an impact where it reaches a plane, and where it does not
constexpr double kStrikes = 4.0, kStrikesAir = -2.0;

// How high above a plane the part of a body is that is within the plane's range, m.
struct Clearance {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -std::numeric_limits<double>::infinity();
  double tolerance = 0.0;  // so far off it may still touch
  bool whole = true;       // all of the body is within the range

  bool touches() const { return lowest < tolerance && highest > -tolerance; }
  bool above() const { return whole && lowest >= tolerance; }
};

Clearance clearanceOf(const SupportPlane& plane, const ObjectModel& model,
                      const Observation& observation, double shape_error) {
  Clearance body;
  const Eigen::Isometry3d& pose = observation.world_from_object;
  for (int i = 0; i < model.mesh.vertexCount(); ++i) {
    const Eigen::Vector3d p = pose * model.mesh.vertex(i);
    if (plane.x_range && (p.x() < plane.x_range->x() || p.x() > plane.x_range->y())) {
      body.whole = false;
      continue;
    }
    const double height = plane.normal.dot(p) - plane.offset;
    body.lowest = std::min(body.lowest, height);
    body.highest = std::max(body.highest, height);
  }
  const double variance =
      plane.normal.dot(observation.covariance.topLeftCorner<3, 3>() * plane.normal);
  body.tolerance = shape_error + kDeviations * std::sqrt(variance);
  return body;
}

// Whether a fall through two heights ends below the tolerance at a third time, in either direction
// of time. A body that enters or leaves the range shows another lowest point in every frame.
// @param fall  m/s^2, towards the plane
bool reaches(const PoseMeasurement& before, const Clearance& height_before,
             const PoseMeasurement& from, const Clearance& height, const PoseMeasurement& to,
             double fall) {
  if (!before.valid || !from.valid || !height_before.whole || !height.above()) return false;
  const double past = std::abs(from.time - before.time), ahead = std::abs(to.time - from.time);
  const double speed = (height.lowest - height_before.lowest) / past - 0.5 * fall * past;
  return height.lowest + speed * ahead - 0.5 * fall * ahead * ahead < height.tolerance;
}

// Where a body falls on to from two poses: its pose `ahead` seconds after the second.
struct Fall {
  Eigen::Vector3d position, velocity, gravity, spin;  // of the centroid; at the second pose
  Eigen::Matrix3d rotation;

  Fall(const PoseMeasurement& before, const PoseMeasurement& from, const Eigen::Vector3d& g)
      : position(from.position), gravity(g), rotation(from.rotation) {
    const double past = from.time - before.time;
    velocity = (from.position - before.position) / past + 0.5 * past * gravity;
    spin = vectorFromRotation(from.rotation * before.rotation.transpose()) / past;
  }
  // From the centroid to the body's lowest point above a plane, world axes.
  Eigen::Vector3d lowestArm(const TriangleMesh& mesh, const Eigen::Vector3d& centroid,
                            const Eigen::Vector3d& up, double ahead) const {
    const Eigen::Matrix3d turned = rotationFromVector(spin * ahead) * rotation;
    const Eigen::VectorXd heights = mesh.vertices * (turned.transpose() * up);
    Eigen::Index lowest = 0;
    heights.minCoeff(&lowest);
    return turned * (mesh.vertex(static_cast<int>(lowest)) - centroid);
  }
  Eigen::Vector3d positionAt(double ahead) const {
    return position + ahead * velocity + 0.5 * ahead * ahead * gravity;
  }
};

// When the lowest point of a body that falls on from two poses reaches a plane, until a time; as
// surely as its height is known: by the poses, which an error of theirs carries on, and its shape.
std::optional<PoseMeasurement::Instant> contactInstant(
    const SupportPlane& plane, const ObjectModel& model, const PoseMeasurement& before,
    const PoseMeasurement& from, double until, const Eigen::Vector3d& gravity, double shape_error) {
  constexpr int kSteps = 16;
  const Fall fall(before, from, gravity);
  const Eigen::Vector3d middle = centroid(model.mesh);
  const auto heightOf = [&](double ahead) {
    const Eigen::Vector3d arm = fall.lowestArm(model.mesh, middle, plane.normal, ahead);
    return plane.normal.dot(fall.positionAt(ahead) + arm) - plane.offset;
  };
  const double step = (until - from.time) / kSteps;
  double height = heightOf(0.0);
  for (int i = 1; i <= kSteps && height > 0.0; ++i) {
    const double next = heightOf(i * step);
    if (next > 0.0) {
      height = next;
      continue;
    }
    const double ahead = (i - 1 + height / (height - next)) * step;
    const Eigen::Vector3d arm = fall.lowestArm(model.mesh, middle, plane.normal, ahead);
    Vector6d by_pose;
    by_pose << plane.normal, arm.cross(plane.normal);
    const double share = ahead / (from.time - before.time);
    const double variance = std::pow(1.0 + share, 2) * by_pose.dot(from.covariance * by_pose) +
                            share * share * by_pose.dot(before.covariance * by_pose) +
                            shape_error * shape_error;
    return PoseMeasurement::Instant{from.time + ahead,
                                    std::sqrt(variance) * step / (height - next)};
  }
  return std::nullopt;
}

}  // namespace

void noteContacts(const std::vector<SupportPlane>& planes, const ObjectModel& model,
                  const std::vector<Observation>& observations, const Eigen::Vector3d& gravity,
                  std::vector<PoseMeasurement>& measurements) {
  if (planes.empty()) return;
  const double shape_error = kShapeError * boundingDiagonal(model.mesh);
  const size_t count = measurements.size();
  std::vector<bool> clear(count, true), strikes(count, false);
  for (const SupportPlane& plane : planes) {
    std::vector<Clearance> heights;
    for (const Observation& o : observations)
      heights.push_back(clearanceOf(plane, model, o, shape_error));
    const double fall = -plane.normal.dot(gravity);
    const auto touches = [&](size_t k) { return measurements[k].valid && heights[k].touches(); };
    const auto falls = [&](size_t before, size_t from, size_t to) {
      return reaches(measurements[before], heights[before], measurements[from], heights[from],
                     measurements[to], fall);
    };
    for (size_t k = 0; k < count; ++k) {
      if (touches(k)) clear[k] = false;
      if (k == 0) continue;
      if (k > 1 && falls(k - 2, k - 1, k) && heights[k].whole) {
        const auto contact = contactInstant(plane, model, measurements[k - 2], measurements[k - 1],
                                            measurements[k].time, gravity, shape_error);
        if (contact && (!measurements[k].contact || contact->time < measurements[k].contact->time))
          measurements[k].contact = contact;
      }
      if (touches(k - 1) || touches(k) || (k > 1 && falls(k - 2, k - 1, k)) ||
          (k + 1 < count && falls(k + 1, k, k - 1)))
        strikes[k] = true;
    }
  }
  const bool held = !model.attached.empty();
  for (size_t k = 0; k < count; ++k) {
    measurements[k].falls = measurements[k].valid && clear[k] && !held ? kFalls : 0.0;
    const bool known = k > 0 && measurements[k].valid && measurements[k - 1].valid;
    measurements[k].strikes = strikes[k] ? kStrikes : known ? kStrikesAir : 0.0;
  }
}

}  // namespace calipso::flow
