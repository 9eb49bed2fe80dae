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

// Gap of a point at the start of the step; nothing if it is further than `reach` (m). `size`:
// length scale of the object the point belongs to, m: depths are found up to a tenth of it.
std::optional<ObstacleHit> queryObstacle(const Obstacle& obstacle, const Eigen::Vector3d& point,
                                         double reach, double size);

// Where an obstacle carries a surface against gravity: what lies deepest, if anything is within
// `reach` (m).
std::optional<ObstacleHit> carrying(const Obstacle& obstacle, const TriangleMesh& surface,
                                    const Eigen::Vector3d& gravity, double reach);

// Box around everything the obstacle may touch; empty for planes, which are everywhere.
Eigen::AlignedBox3d obstacleBounds(const Obstacle& obstacle);

// Whether a point is inside of a closed surface, by its winding number: holds where the surface
// folds, and where the nearest point's normal says nothing.
bool encloses(const TriangleMesh& surface, const Eigen::Vector3d& point);

}  // namespace calipso::fem
