#pragma once

#include <Eigen/Geometry>
#include <string>

#include "calipso_scene/scene.hpp"

namespace calipso::bag {

// Where rviz's orbiting view begins: all objects fill it, seen from the video's side but a little
// from above and beside, so that depth shows.
struct OrbitView {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // world, m
  double distance = 1.0;                             // m
  double yaw = 0.0, pitch = 0.0;                     // rad, of the eye as seen from the middle
};

// A box in the world around all objects at their rough places and the places on supports beneath
// them that the video shows; empty without objects.
// @throw std::runtime_error if a model cannot be read
Eigen::AlignedBox3d objectBounds(const Scene& scene);

// @pre bounds is not empty
OrbitView orbitView(const Eigen::AlignedBox3d& bounds, const Eigen::Isometry3d& world_from_camera);

// An rviz configuration with view, grid and axes of frames as suits a scene of any size.
// @throw std::runtime_error if `config` is no configuration with an orbiting view
std::string rvizConfigFor(const Scene& scene, const std::string& config);

}  // namespace calipso::bag
