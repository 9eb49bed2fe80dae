#include "calipso_fem/world/wind.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace calipso::fem {

Vertices windForces(const Vertices& x, const Vertices& u, const Triangles& triangles,
                    const Air& air, double areal_density, double h) {
  Vertices forces = Vertices::Zero(x.rows(), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Eigen::RowVector3i face = triangles.row(t);
    const Eigen::Vector3d a = x.row(face[0]), b = x.row(face[1]), c = x.row(face[2]);
    const Eigen::Vector3d doubled = (b - a).cross(c - a);
    const double area = 0.5 * doubled.norm();
    if (area == 0.0) continue;
    const Eigen::Vector3d n = doubled / (2.0 * area);
    const Eigen::Vector3d velocity =
        (u.row(face[0]) + u.row(face[1]) + u.row(face[2])).transpose() / 3.0;
    const double speed = (air.wind - velocity).dot(n);
    const double pressure = 0.5 * air.drag * speed * std::abs(speed);
    const double damping = h > 0.0 ? 1.0 + h * air.drag * std::abs(speed) / areal_density : 1.0;
    const Eigen::RowVector3d third = (pressure * area / (3.0 * damping) * n).transpose();
    for (int k = 0; k < 3; ++k) forces.row(face[k]) += third;
  }
  return forces;
}

}  // namespace calipso::fem
