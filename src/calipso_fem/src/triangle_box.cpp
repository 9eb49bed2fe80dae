#include "triangle_box.hpp"

#include <Eigen/Geometry>

namespace calipso::fem {
namespace {

// Whether the projections of triangle and centred cube on the axis are disjoint.
bool separates(const Eigen::Vector3d& axis, const Eigen::Matrix3d& t, double half) {
  const Eigen::RowVector3d p = axis.transpose() * t;
  const double reach = half * axis.lpNorm<1>();
  return p.minCoeff() > reach || p.maxCoeff() < -reach;
}

}  // namespace

bool triangleMeetsUnitCube(const Eigen::Matrix3d& corners, const Eigen::Vector3d& low,
                           double margin) {
  const double half = 0.5 - margin;
  const Eigen::Matrix3d t = corners.colwise() - (low + Eigen::Vector3d::Constant(0.5));
  const Eigen::Vector3d edges[3] = {t.col(1) - t.col(0), t.col(2) - t.col(1), t.col(0) - t.col(2)};
  for (int a = 0; a < 3; ++a)
    if (separates(Eigen::Vector3d::Unit(a), t, half)) return false;
  if (separates(edges[0].cross(edges[1]), t, half)) return false;
  for (int a = 0; a < 3; ++a)
    for (const Eigen::Vector3d& edge : edges)
      if (separates(Eigen::Vector3d::Unit(a).cross(edge), t, half)) return false;
  return true;
}

}  // namespace calipso::fem
