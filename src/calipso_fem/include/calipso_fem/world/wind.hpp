#pragma once

#include <Eigen/Core>

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

using Vertices = decltype(TriangleMesh::vertices);
using Triangles = decltype(TriangleMesh::triangles);

// A surface in moving air. Pressure on a face with unit normal n and velocity u:
//   p = drag ((w - u).n) |(w - u).n| / 2  along n        (quadratic drag of thin sheets)
//  symbol  code       meaning                                        unit
//  w       wind       velocity of the air                            m/s
//          drag       density of the air times coefficient of drag;  kg/m^3
//                     half of it for a closed mesh, which turns two faces to the wind for each
//                     sheet
struct Air {
  Eigen::Vector3d wind = Eigen::Vector3d::Zero();
  double drag = 0.0;
};

// Forces on the vertices, #V x 3, N.
// @param x, u positions (m) and velocities (m/s) of the vertices, #V x 3
// @param areal_density of the sheet, kg/m^2
// @param h s: the force is damped by the change of u that it brings about within a step, so that a
//   light sheet takes on the wind's speed instead of overshooting it; 0: undamped
Vertices windForces(const Vertices& x, const Vertices& u, const Triangles& triangles,
                    const Air& air, double areal_density, double h);

}  // namespace calipso::fem
