#include "obstacle_query.hpp"

#include <algorithm>

namespace calipso::fem {
namespace {

std::optional<ObstacleHit> queryPlane(const SupportPlane& plane, const Eigen::Vector3d& before,
                                      const Eigen::Vector3d& now, double reach, double size) {
  const double gap = plane.normal.dot(now) - plane.offset;
  if (gap > reach) return std::nullopt;
  if (plane.x_range) {
    // The strip is a ledge: what is far below it has not passed through it.
    const bool beside = now.x() < plane.x_range->x() || now.x() > plane.x_range->y();
    const bool passed = plane.normal.dot(before) > plane.offset - 0.05 * size;
    if (beside || !passed) return std::nullopt;
  }
  return ObstacleHit{gap, plane.normal, now - gap * plane.normal, {}};
}

}  // namespace

std::optional<ObstacleHit> queryObstacle(const Obstacle& obstacle, const Eigen::Vector3d& before,
                                         const Eigen::Vector3d& now, double reach, double size) {
  if (obstacle.plane) return queryPlane(*obstacle.plane, before, now, reach, size);
  const Eigen::Vector3d from = obstacle.previous_pose.inverse() * before;
  const Eigen::Vector3d to = obstacle.pose.inverse() * now;
  // Depths are searched further than gaps, so that what got in is found again.
  auto hit = obstacle.tree->firstEntry(from, to);
  if (!hit) hit = obstacle.tree->nearest(to, std::max(reach, 0.1 * size));
  if (!hit || hit->distance > reach) return std::nullopt;
  ObstacleHit result{
      hit->distance, obstacle.pose.linear() * hit->normal, obstacle.pose * hit->point, {}};
  result.other = SurfacePoint::onTriangle(
      obstacle.tree->mesh().triangles.row(hit->triangle).transpose(), hit->barycentric);
  return result;
}

Eigen::AlignedBox3d obstacleBounds(const Obstacle& obstacle) {
  Eigen::AlignedBox3d box;
  if (obstacle.plane) return box;
  for (int c = 0; c < 8; ++c)
    for (const Eigen::Isometry3d* pose : {&obstacle.pose, &obstacle.previous_pose})
      box.extend(*pose *
                 obstacle.tree->bounds().corner(static_cast<Eigen::AlignedBox3d::CornerType>(c)));
  return box;
}

Eigen::Vector3d obstacleVelocity(const Obstacle& obstacle, const SurfacePoint& other,
                                 const Eigen::Vector3d& place, const RigidWorld& rigid, double h) {
  if (obstacle.soft) return obstacle.soft->velocity(other);
  if (obstacle.rigid)
    return rigid.linearVelocity(*obstacle.rigid) + h * obstacle.acceleration +
           rigid.angularVelocity(*obstacle.rigid).cross(place - rigid.center(*obstacle.rigid));
  return (place - obstacle.previous_pose * (obstacle.pose.inverse() * place)) / h;
}

}  // namespace calipso::fem
