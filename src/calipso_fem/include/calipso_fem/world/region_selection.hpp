#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "calipso_fem/world/world_types.hpp"

namespace calipso::fem {

struct RayHit {
  int object = 0;  // index into the scene's objects
  int triangle = 0;
  double depth = 0.0;                               // along the ray, in lengths of its direction
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // world, m
};

// Nearest intersection of the ray with the objects as they stand at the key frame.
// @param besides index of an object that counts though the video does not have it; -1: none
std::optional<RayHit> castRay(const WorldScene& scene, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction, int besides = -1);

// Vertices of the scene's object `object` that a region chooses at the key frame, ascending.
// @throw std::invalid_argument when the region meets no vertex of the object, naming the remedy
std::vector<int> selectVertices(const WorldScene& scene, int object, const Region& region);

}  // namespace calipso::fem
