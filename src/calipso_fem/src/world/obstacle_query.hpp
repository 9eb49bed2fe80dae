#pragma once

#include <optional>

#include "calipso_fem/world/soft_contacts.hpp"

namespace calipso::fem {

// Where a point stands relative to an obstacle.
struct ObstacleHit {
  double gap = 0.0;                                   // m, negative inside
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // outwards, world
  Eigen::Vector3d place = Eigen::Vector3d::Zero();    // nearest point of the obstacle, world
  SurfacePoint other;                                 // the same on a deformable obstacle
};

// Gap of the point `now` that was at `before` when the step began; nothing if it is further than
// `reach` and did not pass through. `size`: length scale of the moving object, m.
std::optional<ObstacleHit> queryObstacle(const Obstacle& obstacle, const Eigen::Vector3d& before,
                                         const Eigen::Vector3d& now, double reach, double size);

// Box around everything the obstacle may touch; empty for planes, which are everywhere.
Eigen::AlignedBox3d obstacleBounds(const Obstacle& obstacle);

// Velocity of the obstacle's surface at a hit by the end of the step, m/s.
Eigen::Vector3d obstacleVelocity(const Obstacle& obstacle, const SurfacePoint& other,
                                 const Eigen::Vector3d& place, const RigidWorld& rigid, double h);

}  // namespace calipso::fem
