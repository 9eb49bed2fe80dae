#include "calipso_align/low_order_map.hpp"

#include <cmath>

namespace calipso::align {
namespace {

Eigen::Matrix<double, 6, 1> monomials(const Eigen::Vector3d& y) {
  Eigen::Matrix<double, 6, 1> m;
  m << y.x() * y.x(), y.y() * y.y(), y.z() * y.z(), y.x() * y.y(), y.x() * y.z(), y.y() * y.z();
  return m;
}

// Column k is d(E y)/dE_k for E = (xx, yy, zz, xy, xz, yz).
Eigen::Matrix<double, 3, 6> strainBasis(const Eigen::Vector3d& y) {
  Eigen::Matrix<double, 3, 6> b;
  b << y.x(), 0, 0, y.y(), y.z(), 0, 0, y.y(), 0, y.x(), 0, y.z(), 0, 0, y.z(), 0, y.x(), y.y();
  return b;
}

Eigen::Matrix3d rotationOf(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-15) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

LowOrderMap::LowOrderMap(const Points& X) : c_(X.colwise().mean().transpose()) {
  l_ = std::sqrt((X.rowwise() - c_.transpose()).rowwise().squaredNorm().mean());
}

void LowOrderMap::setParameters(const Parameters& p) {
  p_ = p;
  R_ = rotationOf(p.segment<3>(kRotation));
  s_ = std::exp(p[kLogScale]);
}

Eigen::Vector3d LowOrderMap::deformed(const Eigen::Vector3d& d) const {
  const Eigen::Vector3d y = d / l_;
  const Eigen::Matrix<double, 6, 1> m = monomials(y);
  Eigen::Vector3d q;
  for (int k = 0; k < 3; ++k) q[k] = p_.segment<6>(kQuadratic + 6 * k).dot(m);
  return d + l_ * (strainBasis(y) * p_.segment<6>(kStrain) + q);
}

Eigen::Vector3d LowOrderMap::operator()(const Eigen::Vector3d& X) const {
  return c_ + p_.segment<3>(kTranslation) + s_ * (R_ * deformed(X - c_));
}

Points LowOrderMap::apply(const Points& X) const {
  Points x(X.rows(), 3);
#pragma omp parallel for schedule(static)
  for (int i = 0; i < X.rows(); ++i) x.row(i) = (*this)(X.row(i).transpose()).transpose();
  return x;
}

LowOrderMap::Jacobian LowOrderMap::jacobian(const Eigen::Vector3d& X) const {
  const Eigen::Vector3d d = X - c_, y = d / l_;
  const Eigen::Vector3d turned = s_ * (R_ * deformed(d));
  const Eigen::Matrix<double, 6, 1> m = monomials(y);
  Jacobian J;
  J.middleCols<3>(kRotation) = -skew(turned);
  J.middleCols<3>(kTranslation).setIdentity();
  J.col(kLogScale) = turned;
  J.middleCols<6>(kStrain) = s_ * l_ * (R_ * strainBasis(y));
  for (int k = 0; k < 3; ++k) {
    J.middleCols<6>(kQuadratic + 6 * k) = s_ * l_ * R_.col(k) * m.transpose();
  }
  return J;
}

LowOrderMap::Parameters LowOrderMap::gradient(const Eigen::Vector3d& X,
                                              const Eigen::Vector3d& g) const {
  const Eigen::Vector3d d = X - c_, y = d / l_;
  const Eigen::Vector3d turned = s_ * (R_ * deformed(d));
  const Eigen::Vector3d h = s_ * l_ * (R_.transpose() * g);
  const Eigen::Matrix<double, 6, 1> m = monomials(y);
  Parameters result;
  result.segment<3>(kRotation) = turned.cross(g);
  result.segment<3>(kTranslation) = g;
  result[kLogScale] = turned.dot(g);
  result.segment<6>(kStrain) << h.x() * y.x(), h.y() * y.y(), h.z() * y.z(),
      h.x() * y.y() + h.y() * y.x(), h.x() * y.z() + h.z() * y.x(), h.y() * y.z() + h.z() * y.y();
  for (int k = 0; k < 3; ++k) result.segment<6>(kQuadratic + 6 * k) = h[k] * m;
  return result;
}

LowOrderMap::Parameters LowOrderMap::plus(const Parameters& step) const {
  Parameters p = p_ + step;
  const Eigen::AngleAxisd turned(rotationOf(step.segment<3>(kRotation)) * R_);
  p.segment<3>(kRotation) = turned.angle() * turned.axis();
  return p;
}

void LowOrderMap::absorbScale() {
  Parameters p = p_;
  p.segment<6>(kStrain) *= s_;
  p.segment<3>(kStrain).array() += s_ - 1.0;
  p.segment<18>(kQuadratic) *= s_;
  p[kLogScale] = 0.0;
  setParameters(p);
}

}  // namespace calipso::align
