#pragma once

#include <Eigen/Geometry>
#include <calipso_scene/triangle_mesh.hpp>
#include <string>
#include <vector>

namespace calipso::flow {

// An object as aligned to the key frame: its surface and where it stands.
struct ObjectModel {
  std::string name;
  int index = 0;                                                        // label in masks
  TriangleMesh mesh;                                                    // object frame, m
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();  // at the key frame
  Eigen::Matrix3d position_covariance = Eigen::Matrix3d::Zero();  // of the placement, world, m^2
  std::vector<int> attached;  // vertices that are held by something that does not move
};

// Centre of mass of the body of uniform density that `mesh` encloses. Where the mesh encloses
// nothing (a sheet, or faces that cancel) it is the centre of the surface.
// @throw std::invalid_argument when the mesh has no triangle or a vertex that is not finite
Eigen::Vector3d centroid(const TriangleMesh& mesh);

}  // namespace calipso::flow
