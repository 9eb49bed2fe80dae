#include "sheet_tangent.hpp"

#include <cmath>

namespace calipso::flow {
namespace {

using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic>;

// Cross product of a vector with every column.
Rows crossed(const Eigen::Vector3d& a, const Rows& b) {
  Eigen::Matrix3d S;
  S << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return S * b;
}

}  // namespace

Eigen::MatrixXd windForceSlopes(const Eigen::VectorXd& x, const Eigen::VectorXd& u, const fem::Triangles& triangles,
                                const fem::Air& air, double areal_density, double h, const Eigen::MatrixXd& dx,
                                const Eigen::MatrixXd& du, const Eigen::MatrixXd& dw) {
  Eigen::MatrixXd dF = Eigen::MatrixXd::Zero(x.size(), dw.cols());
  const double softening = h > 0.0 ? h * air.drag / areal_density : 0.0;
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const int i = 3 * triangles(t, 0), j = 3 * triangles(t, 1), k = 3 * triangles(t, 2);
    const Eigen::Vector3d ab = x.segment<3>(j) - x.segment<3>(i), ac = x.segment<3>(k) - x.segment<3>(i);
    const Eigen::Vector3d S = 0.5 * ab.cross(ac);  // area times normal
    const double area = S.norm();
    if (area == 0.0) continue;
    const Eigen::Vector3d n = S / area;
    const Eigen::Vector3d wind = air.wind - (u.segment<3>(i) + u.segment<3>(j) + u.segment<3>(k)) / 3.0;
    const double s = wind.dot(n), strength = 1.0 + softening * std::abs(s);
    const double pressure = 0.5 * air.drag * s * std::abs(s) / strength;
    const double slope = 0.5 * air.drag * std::abs(s) * (1.0 + strength) / (strength * strength);
    const Rows da = dx.middleRows<3>(i);
    const Rows dS = 0.5 * (crossed(ab, dx.middleRows<3>(k) - da) - crossed(ac, dx.middleRows<3>(j) - da));
    const Rows dwind = dw - (du.middleRows<3>(i) + du.middleRows<3>(j) + du.middleRows<3>(k)) / 3.0;
    const Eigen::RowVectorXd ds = n.transpose() * dwind + (wind - s * n).transpose() * dS / area;
    const Rows third = (pressure * dS + slope * S * ds) / 3.0;
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
  for (Eigen::Index p = 0; p < A_.nonZeros(); ++p) place[static_cast<size_t>(A_.valuePtr()[p])] = static_cast<int>(p);
  for (const int entry : entry_of) slots_.push_back(entry < 0 ? -1 : place[entry]);
  factor_.analyzePattern(A_);
  dx_ = dv_ = Eigen::MatrixXd::Zero(count, parameters);
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

void MotionTangent::advance(const fem::Vec& x0, double h, const Eigen::MatrixXd& dF,
                            const Eigen::VectorXd& viscosity) {
  factorise(x0, h);
  const fem::Vec way = body_.positions() - x0;
  Eigen::MatrixXd b(free_.size(), dF.cols());
  fem::Vec Dx;
  for (Eigen::Index p = 0; p < dF.cols(); ++p) {
    D_.multiply(dx_.col(p) - viscosity[p] * way, Dx);
    for (size_t f = 0; f < free_.size(); ++f) {
      const int d = free_[f];
      b(f, p) = mass_[d] * (dx_(d, p) / (h * h) + dv_(d, p) / h) + Dx[d] / h + dF(d, p);
    }
  }
  const Eigen::MatrixXd moved = factor_.solve(b);
  for (size_t f = 0; f < free_.size(); ++f) {
    const int d = free_[f];
    dv_.row(d) = (moved.row(f) - dx_.row(d)) / h;
    dx_.row(d) = moved.row(f);
  }
}

}  // namespace calipso::flow
