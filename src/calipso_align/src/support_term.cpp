#include "calipso_align/support_term.hpp"

#include <algorithm>

namespace calipso::align {
namespace {

// Whether the plane reaches under the point.
bool reachesUnder(const SupportPlane& plane, const Camera& camera, const Eigen::Vector3d& p) {
  if (!plane.x_range) return true;
  const double x = (camera.world_from_camera * p).x();
  return x >= plane.x_range->x() && x <= plane.x_range->y();
}

// The lowest vertex above the plane, or -1.
int lowestVertex(const SupportTarget& target, const Points& x, const Camera& camera) {
  int lowest = -1;
  double height = 0.0;
  for (int i = 0; i < x.rows(); ++i) {
    const double h = target.normal.dot(x.row(i)) - target.offset;
    if ((lowest >= 0 && h >= height) || !reachesUnder(target.plane, camera, x.row(i))) continue;
    lowest = i;
    height = h;
  }
  return lowest;
}

}  // namespace

std::vector<SupportTarget> makeSupportTargets(const std::vector<SupportPlane>& planes,
                                              const Camera& camera) {
  std::vector<SupportTarget> targets;
  const Eigen::Isometry3d& world_from_camera = camera.world_from_camera;
  for (const SupportPlane& plane : planes) {
    targets.push_back({plane, world_from_camera.linear().transpose() * plane.normal,
                       plane.offset - plane.normal.dot(world_from_camera.translation()), false});
  }
  return targets;
}

std::optional<double> clearance(const SupportTarget& target, const Points& x,
                                const Camera& camera) {
  const int lowest = lowestVertex(target, x, camera);
  if (lowest < 0) return std::nullopt;
  return target.normal.dot(x.row(lowest)) - target.offset;
}

double reachesThrough(double sigma) {
  constexpr double kDeviations = 5.0;
  return kDeviations * sigma;
}

Rows supportRows(const std::vector<SupportTarget>& targets, const Points& x, const Camera& camera,
                 double sigma) {
  Rows rows;
  for (const SupportTarget& target : targets) {
    const size_t first = rows.size();
    const int lowest = target.stands ? lowestVertex(target, x, camera) : -1;
    for (int i = 0; i < x.rows(); ++i) {
      const double h = target.normal.dot(x.row(i)) - target.offset;
      if (i != lowest && (h >= 0.0 || !reachesUnder(target.plane, camera, x.row(i)))) continue;
      rows.push_back(vertexRow(i, target.normal, h, 1.0));
    }
    // One contact, however many vertices the mesh spends on it.
    const double weight = 1.0 / (sigma * sigma * std::max<size_t>(1, rows.size() - first));
    for (size_t k = first; k < rows.size(); ++k) {
      // What other measurements hold far below a plane reaches through it, as a pier through water.
      const double trust = target.stands ? 1.0 : gemanMcClure(rows[k].r, reachesThrough(sigma));
      rows[k].weight = weight * trust;
    }
  }
  return rows;
}

}  // namespace calipso::align
