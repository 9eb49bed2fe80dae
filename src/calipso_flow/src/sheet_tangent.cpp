#include "sheet_tangent.hpp"

#include <cmath>

namespace calipso::flow {
Slopes windForceSlopes(const Eigen::VectorXd& x, const Eigen::VectorXd& u,
                       const fem::Triangles& triangles, const fem::Air& air, double areal_density,
                       double h, const Slopes& dx, const Slopes& du, const Slopes& dw) {
  Slopes dF = Slopes::Zero(x.size(), dw.cols());
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor> ab(3, dw.cols()), ac(3, dw.cols()),
      dS(3, dw.cols()), third(3, dw.cols());
  Eigen::RowVectorXd ds(dw.cols());
  const double softening = h > 0.0 ? h * air.drag / areal_density : 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const int i = 3 * triangles(t, 0), j = 3 * triangles(t, 1), k = 3 * triangles(t, 2);
    const Eigen::Vector3d p = x.segment<3>(j) - x.segment<3>(i),
                          q = x.segment<3>(k) - x.segment<3>(i);
    const Eigen::Vector3d S = 0.5 * p.cross(q);  // area times normal
    const double area = S.norm();
    if (area == 0.0) continue;
    const Eigen::Vector3d n = S / area;
    const Eigen::Vector3d wind =
        air.wind - (u.segment<3>(i) + u.segment<3>(j) + u.segment<3>(k)) / 3.0;
    const double s = wind.dot(n), strength = 1.0 + softening * std::abs(s);
    const double pressure = 0.5 * air.drag * s * std::abs(s) / strength;
    const double slope = 0.5 * air.drag * std::abs(s) * (1.0 + strength) / (strength * strength);
    const Eigen::Vector3d across = (wind - s * n) / area;
    ab = dx.middleRows<3>(j) - dx.middleRows<3>(i);
    ac = dx.middleRows<3>(k) - dx.middleRows<3>(i);
    ds.setZero();
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      dS.row(a) = 0.5 * (p[b] * ac.row(c) - p[c] * ac.row(b) - q[b] * ab.row(c) + q[c] * ab.row(b));
      ds += across[a] * dS.row(a) +
            n[a] * (dw.row(a) - (du.row(i + a) + du.row(j + a) + du.row(k + a)) / 3.0);
    }
    for (int a = 0; a < 3; ++a) third.row(a) = (pressure * dS.row(a) + slope * S[a] * ds) / 3.0;
    for (const int corner : {i, j, k}) dF.middleRows<3>(corner) += third;
  }
  return dF;
}

MotionTangent::MotionTangent(int components, int parameters)
    : dx_(Slopes::Zero(components, parameters)), dv_(dx_) {}

void MotionTangent::advance(const SheetStep& step, const fem::Vec& moved, double h,
                            const Slopes& dF, const Eigen::VectorXd& viscosity) {
  const Slopes moving = dx_ - moved * viscosity.transpose();
  Slopes all = dF;
  for (Eigen::Index d = 0; d < all.rows(); ++d) {
    all.row(d) += step.mass()[d] * (dx_.row(d) / (h * h) + dv_.row(d) / h);
  }
  const fem::BlockMatrix& D = step.viscosity();
  const fem::BlockPattern& pattern = *D.pattern;
  for (int i = 0; i < pattern.rows(); ++i) {
    for (int b = pattern.row_start[i]; b < pattern.row_start[i + 1]; ++b) {
      all.middleRows<3>(3 * i).noalias() +=
          D.block(b) / h * moving.middleRows<3>(3 * pattern.column[b]);
    }
  }
  const Slopes next = step.solve(all);
  dv_ = (next - dx_) / h;
  dx_ = next;
}

}  // namespace calipso::flow
