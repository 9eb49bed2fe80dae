#include "obstacle_query.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

namespace calipso::fem {
namespace {

std::optional<ObstacleHit> queryPlane(const SupportPlane& plane, const Eigen::Vector3d& point,
                                      double reach, double size) {
  const double gap = plane.normal.dot(point) - plane.offset;
  if (gap > reach) return std::nullopt;
  if (plane.x_range) {
    // The strip is a ledge: what is far below it has not passed through it.
    const bool beside = point.x() < plane.x_range->x() || point.x() > plane.x_range->y();
    if (beside || gap < -0.05 * size) return std::nullopt;
  }
  return ObstacleHit{gap, plane.normal, point - gap * plane.normal, {}};
}

}  // namespace

std::optional<ObstacleHit> queryObstacle(const Obstacle& obstacle, const Eigen::Vector3d& point,
                                         double reach, double size) {
  if (obstacle.plane) return queryPlane(*obstacle.plane, point, reach, size);
  const Eigen::Isometry3d& pose = obstacle.previous_pose;
  // Depths are searched further than gaps, so that what got in is found again.
  const auto hit = obstacle.tree->nearest(pose.inverse() * point, std::max(reach, 0.1 * size));
  if (!hit || hit->distance > reach) return std::nullopt;
  ObstacleHit result{hit->distance, pose.linear() * hit->normal, pose * hit->point, {}};
  result.other = SurfacePoint::onTriangle(
      obstacle.tree->mesh().triangles.row(hit->triangle).transpose(), hit->barycentric);
  return result;
}

std::optional<ObstacleHit> carrying(const Obstacle& obstacle, const TriangleMesh& surface,
                                    const Eigen::Vector3d& gravity, double reach) {
  constexpr double kUpright = 0.3;  // cosine to the vertical of a normal that carries
  std::optional<ObstacleHit> deepest;
  if (!(gravity.norm() > 0.0)) return deepest;
  const Eigen::Vector3d up = -gravity.normalized();
  const Eigen::AlignedBox3d bounds(
      surface.vertices.colwise().minCoeff().transpose().array() - reach,
      surface.vertices.colwise().maxCoeff().transpose().array() + reach);
  const Eigen::AlignedBox3d box = obstacleBounds(obstacle);
  if (!box.isEmpty() && !box.intersects(bounds)) return deepest;
  const double size = boundingDiagonal(surface);
  for (int v = 0; v < surface.vertexCount(); ++v) {
    const auto hit = queryObstacle(obstacle, surface.vertex(v), reach, size);
    if (hit && hit->normal.dot(up) > kUpright && (!deepest || hit->gap < deepest->gap))
      deepest = hit;
  }
  return deepest;
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

// Sum of the triangles' solid angles (Van Oosterom and Strackee 1983), above 2 pi inside. Each half
// of one is the argument of a complex number; their product and its turns take the place of the
// sum.
bool encloses(const TriangleMesh& surface, const Eigen::Vector3d& point) {
  std::complex<double> product = 1.0;
  int turns = 0;
  for (int f = 0; f < surface.triangles.rows(); ++f) {
    const Eigen::Vector3d a = surface.vertex(surface.triangles(f, 0)) - point,
                          b = surface.vertex(surface.triangles(f, 1)) - point,
                          c = surface.vertex(surface.triangles(f, 2)) - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    const std::complex<double> half(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb,
                                    a.dot(b.cross(c)));
    const double size = std::abs(half.real()) + std::abs(half.imag());
    if (size == 0.0) continue;  // a triangle without area, or at one of its corners
    const bool upper = product.imag() >= 0.0;
    product *= half / size;
    product /= std::abs(product.real()) + std::abs(product.imag());
    if (upper && half.imag() > 0.0 && product.imag() < 0.0) ++turns;
    if (!upper && half.imag() < 0.0 && product.imag() >= 0.0) --turns;
  }
  return turns > 0;
}

}  // namespace calipso::fem
