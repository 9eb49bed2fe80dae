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

MotionTangent::MotionTangent(const fem::DeformableBody& body, int parameters)
    : body_(body), mass_(3 * body.nodeCount()) {
  const int count = 3 * body.nodeCount();
  std::vector<int> index(count, -1);
  for (int d = 0; d < count; ++d) {
    mass_[d] = body.model().lumpedMass()[d / 3];
    if (body.isFixed(d / 3)) continue;
    index[d] = static_cast<int>(free_.size());
    free_.push_back(d);
  }
  // Every entry is given its number as value, to find the place that it gets.
  const fem::BlockPattern& pattern = *body.model().pattern();
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<int> entry_of(9 * pattern.blockCount(), -1);
  for (int i = 0; i < pattern.rows(); ++i) {
    for (int b = pattern.row_start[i]; b < pattern.row_start[i + 1]; ++b) {
      for (int e = 0; e < 9; ++e) {
        const int row = index[3 * i + e / 3], column = index[3 * pattern.column[b] + e % 3];
        if (column < 0 || row < column) continue;
        entry_of[9 * b + e] = static_cast<int>(entries.size());
        entries.emplace_back(row, column, static_cast<double>(entries.size()));
      }
    }
  }
  A_.resize(free_.size(), free_.size());
  A_.setFromTriplets(entries.begin(), entries.end());
  std::vector<int> place(entries.size());
  for (Eigen::Index p = 0; p < A_.nonZeros(); ++p)
    place[static_cast<size_t>(A_.valuePtr()[p])] = static_cast<int>(p);
  for (const int entry : entry_of) slots_.push_back(entry < 0 ? -1 : place[entry]);
  factor_.analyzePattern(A_);
  dx_ = dv_ = Slopes::Zero(count, parameters);
}

void MotionTangent::factorise(const fem::Vec& x0, double h) {
  body_.model().hessian(body_.positions(), fem::Definiteness::kExact, K_);
  body_.model().viscosity(x0, D_);
  for (double& value : D_.values) value *= body_.model().cellMaterials().front().damping;
  for (size_t e = 0; e < slots_.size(); ++e) {
    if (slots_[e] >= 0) A_.valuePtr()[slots_[e]] = K_.values[e] + D_.values[e] / h;
  }
  for (size_t f = 0; f < free_.size(); ++f) A_.coeffRef(f, f) += mass_[free_[f]] / (h * h);
  factor_.factorize(A_);
}

void MotionTangent::advance(const fem::Vec& x0, double h, const Slopes& dF,
                            const Eigen::VectorXd& viscosity) {
  factorise(x0, h);
  const Slopes moving = dx_ - (body_.positions() - x0) * viscosity.transpose();
  Slopes all = dF;
  for (Eigen::Index d = 0; d < all.rows(); ++d) {
    all.row(d) += mass_[d] * (dx_.row(d) / (h * h) + dv_.row(d) / h);
  }
  const fem::BlockPattern& pattern = *D_.pattern;
  for (int i = 0; i < pattern.rows(); ++i) {
    for (int b = pattern.row_start[i]; b < pattern.row_start[i + 1]; ++b) {
      all.middleRows<3>(3 * i).noalias() +=
          D_.block(b) / h * moving.middleRows<3>(3 * pattern.column[b]);
    }
  }
  Eigen::MatrixXd b(free_.size(), dF.cols());
  for (size_t f = 0; f < free_.size(); ++f) b.row(f) = all.row(free_[f]);
  const Eigen::MatrixXd moved = factor_.solve(b);
  for (size_t f = 0; f < free_.size(); ++f) {
    const int d = free_[f];
    dv_.row(d) = (moved.row(f) - dx_.row(d)) / h;
    dx_.row(d) = moved.row(f);
  }
}

}  // namespace calipso::flow
