#include "support_contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {
namespace {

constexpr double kShapeError = 0.01;  // of the diagonal: so well the lowest point is known
constexpr double kDeviations = 2.0;   // of a pose: so far off it is taken for clear
// log odds, per frame without anything that could hold it, of falling against being held
constexpr double kFalls = 1.5;
// log odds, besides the usual, of an impact where it reaches a plane, and where it does not
constexpr double kStrikes = 4.0, kStrikesAir = -2.0;

// Of a body's lowest point above the planes.
struct Clearance {
  double height = std::numeric_limits<double>::infinity();  // m
  double tolerance = 0.0;                                   // m; below it the body may touch
};

Clearance clearanceOf(const SupportPlane& plane, const ObjectModel& model,
                      const Observation& observation, double shape_error) {
  Clearance clearance;
  const Eigen::Isometry3d& pose = observation.world_from_object;
  for (int i = 0; i < model.mesh.vertexCount(); ++i) {
    const Eigen::Vector3d p = pose * model.mesh.vertex(i);
    if (plane.x_range && (p.x() < plane.x_range->x() || p.x() > plane.x_range->y())) continue;
    clearance.height = std::min(clearance.height, plane.normal.dot(p) - plane.offset);
  }
  const double variance =
      plane.normal.dot(observation.covariance.topLeftCorner<3, 3>() * plane.normal);
  clearance.tolerance = shape_error + kDeviations * std::sqrt(variance);
  return clearance;
}

// Whether a fall through three heights ends below the tolerance at the next, in either direction of
// time. @param fall  m/s^2, towards the plane
bool reaches(const PoseMeasurement& before, double height_before, const PoseMeasurement& from,
             const Clearance& height, const PoseMeasurement& to, double fall) {
  const double past = std::abs(from.time - before.time), ahead = std::abs(to.time - from.time);
  const double speed = (height.height - height_before) / past - 0.5 * fall * past;
  return height.height + speed * ahead - 0.5 * fall * ahead * ahead < height.tolerance;
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
    const auto touches = [&](size_t k) { return heights[k].height < heights[k].tolerance; };
    const auto seen = [&](size_t k) { return k < count && measurements[k].valid; };
    const auto falls = [&](size_t before, size_t from, size_t to) {
      return seen(before) && seen(from) &&
             reaches(measurements[before], heights[before].height, measurements[from],
                     heights[from], measurements[to], fall);
    };
    for (size_t k = 0; k < count; ++k) {
      if (touches(k)) clear[k] = false;
      if (k == 0) continue;
      if (touches(k - 1) || touches(k) || (k > 1 && falls(k - 2, k - 1, k)) ||
          falls(k + 1, k, k - 1))
        strikes[k] = true;
    }
  }
  for (size_t k = 0; k < count; ++k) {
    measurements[k].falls = measurements[k].valid && clear[k] ? kFalls : 0.0;
    const bool known = k > 0 && measurements[k].valid && measurements[k - 1].valid;
    measurements[k].strikes = strikes[k] ? kStrikes : known ? kStrikesAir : 0.0;
  }
}

}  // namespace calipso::flow
