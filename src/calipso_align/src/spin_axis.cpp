#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "calipso_align/surface_distance.hpp"
#include "calipso_align/trust.hpp"

namespace calipso::align {

std::optional<Eigen::Vector3d> spinAxis(const Points& X, const Triangles& triangles) {
  // of the size: r.m.s. of what the surface may differ after a turn, a polygon for a circle and
  // small parts included
  constexpr double kSymmetric = 0.01;
  constexpr double kTurn = 0.4;  // rad; brings no regular polygon of up to 14 corners onto itself
  constexpr int kMost = 300;     // vertices that are looked at
  const Points d = X.rowwise() - X.colwise().mean();
  const double size = std::sqrt(d.rowwise().squaredNorm().mean());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(d.transpose() * d);
  const int step = std::max<int>(1, static_cast<int>(d.rows()) / kMost);
  Points some((d.rows() + step - 1) / step, 3);
  for (int i = 0; i < some.rows(); ++i) some.row(i) = d.row(step * i);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = axes.eigenvectors().col(k);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(kTurn, axis).toRotationMatrix();
    const std::vector<double> off = distancesToSurface(some * turn.transpose(), d, triangles);
    const double square = std::inner_product(off.begin(), off.end(), off.begin(), 0.0);
    if (std::sqrt(square / off.size()) < kSymmetric * size) return axis;
  }
  return std::nullopt;
}

}  // namespace calipso::align
