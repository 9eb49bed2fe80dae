#pragma once

#include <Eigen/Geometry>
#include <string>

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

// Mass, centre and inertia of a homogeneous solid, in the frame of its mesh.
struct MassProperties {
  double volume = 0.0;                                // m^3
  double mass = 0.0;                                  // kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   // m
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre, kg m^2
  std::string note;  // how a mesh that is no closed solid was completed; empty when it is one
};

// Exact integrals over the enclosed solid. Inside-out meshes are turned; where the mesh encloses no
// volume (open, or flat), or parts of it are inside out, so that the integrals are no solid's, the
// convex hull of its vertices stands in, and `note` says so.
// @throw std::invalid_argument if density is not positive or even the hull is flat
MassProperties massProperties(const TriangleMesh& mesh, double density);

// True when every edge joins exactly two triangles that run along it in opposite directions.
bool isClosed(const TriangleMesh& mesh);
double surfaceArea(const TriangleMesh& mesh);  // m^2

// Convex hull, triangulated. @throw std::invalid_argument if the vertices lie in one plane
TriangleMesh convexHull(const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points);
// All vertices lie in one plane: such a mesh has no mass, not even that of its hull.
bool isFlat(const TriangleMesh& mesh);

}  // namespace calipso::fem
