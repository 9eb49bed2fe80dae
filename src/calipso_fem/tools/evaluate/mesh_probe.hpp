#pragma once

#include <functional>
#include <vector>

#include "calipso_fem/deformable_body.hpp"

namespace calipso::fem {

// Nodes whose rest position lies on the plane coordinate[axis] = value, to 1e-9 of the mesh's size.
std::vector<int> nodesOnPlane(const VolumeMesh& mesh, int axis, double value);

// Nodal forces (3n, N) of a dead traction (N/m^2 of rest area) on the cell faces in that plane.
Vec planeTraction(const VolumeMesh& mesh, int axis, double value, const Eigen::Vector3d& traction);

// Displacement of the material point at rest position p: linear in tetrahedra, and in hexahedra by
// inverting the trilinear map. @throw std::invalid_argument when no cell holds p
Eigen::Vector3d displacementAt(const VolumeMesh& mesh, const Vec& x, const Eigen::Vector3d& p);

}  // namespace calipso::fem
