#pragma once

#include <vector>

#include "calipso_fem/world/soft_object.hpp"

namespace calipso::fem {

// Inner forces (3n, N) that keep a body which is relaxed where it is from sagging: -K u with the sag u under gravity
// that linear elasticity gives for what holds the body, its fixed nodes and springs of `stiffness` (N/m) at the points
// of `hold`. Their sum and moment are zero: where the body is not held, it falls. Sets the points' forces.
Vec prestressAgainst(const Eigen::Vector3d& gravity, const DeformableBody& body, double stiffness,
                     std::vector<HoldPoint>* hold);

}  // namespace calipso::fem
