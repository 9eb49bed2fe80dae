#include "reference_element.hpp"

#include <Eigen/LU>
#include <cmath>
#include <stdexcept>

namespace calipso::fem {
namespace {

Eigen::Vector3d cornerSign(int c) {
  return {(c & 1) ? 1.0 : -1.0, (c & 2) ? 1.0 : -1.0, (c & 4) ? 1.0 : -1.0};
}

double checkedDeterminant(const Eigen::Matrix3d& J) {
  const double j = J.determinant();
  if (!(j > 0.0))
    throw std::invalid_argument(
        "volume mesh: a cell is inverted or has no volume in its rest shape (Jacobian " +
        std::to_string(j) + "); give cells of positive volume");
  return j;
}

ReferenceElement makeTet(const CornerMatrix& X) {
  ReferenceElement r;
  r.corners = 4;
  r.points = 1;
  Eigen::Matrix3d J;  // columns: edges from corner 0
  for (int c = 0; c < 3; ++c) J.col(c) = (X.row(c + 1) - X.row(0)).transpose();
  r.volume = r.weight[0] = checkedDeterminant(J) / 6.0;
  Eigen::Matrix<double, 4, 3> d;
  d << -1, -1, -1, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  r.gradient[0] = d * J.inverse();
  r.center_gradient = r.gradient[0];
  return r;
}

ReferenceElement makeHex(const CornerMatrix& X) {
  ReferenceElement r;
  r.corners = r.points = 8;
  const Eigen::Matrix3d J0 = X.transpose() * hexShapeDerivative(Eigen::Vector3d::Zero());
  const double j0 = checkedDeterminant(J0);
  const Eigen::Matrix3d J0_inverse = J0.inverse();
  r.center_gradient = hexShapeDerivative(Eigen::Vector3d::Zero()) * J0_inverse;
  for (int q = 0; q < 8; ++q) {
    const Eigen::Vector3d xi = gaussPoint(q);
    const Eigen::Matrix<double, 8, 3> d = hexShapeDerivative(xi);
    const Eigen::Matrix3d J = X.transpose() * d;
    const double j = checkedDeterminant(J);
    r.weight[q] = j;
    r.volume += j;
    r.gradient[q] = d * J.inverse();
    for (int k = 0; k < 3; ++k)
      for (int c = 0; c < 3; ++c) {
        r.mode[q][3 * k + c].setZero();
        r.mode[q][3 * k + c].row(c) = xi[k] * j0 / j * J0_inverse.row(k);
      }
    for (int k = 0; k < 3; ++k)
      r.mode[q][kGradientModes + k] =
          xi[k] * xi[(k + 1) % 3] * j0 / j * Eigen::Matrix3d::Identity();
  }
  return r;
}

}  // namespace

Eigen::Matrix<double, 8, 1> hexShape(const Eigen::Vector3d& xi) {
  Eigen::Matrix<double, 8, 1> N;
  for (int c = 0; c < 8; ++c)
    N[c] = 0.125 * (Eigen::Array3d::Ones() + cornerSign(c).array() * xi.array()).prod();
  return N;
}

Eigen::Matrix<double, 8, 3> hexShapeDerivative(const Eigen::Vector3d& xi) {
  Eigen::Matrix<double, 8, 3> d;
  for (int c = 0; c < 8; ++c) {
    const Eigen::Vector3d s = cornerSign(c);
    const Eigen::Array3d f = 1.0 + s.array() * xi.array();
    d.row(c) << s.x() * f.y() * f.z(), s.y() * f.x() * f.z(), s.z() * f.x() * f.y();
  }
  return 0.125 * d;
}

Eigen::Vector3d gaussPoint(int q) { return cornerSign(q) / std::sqrt(3.0); }

ReferenceElement makeReferenceElement(const CornerMatrix& corners) {
  return corners.rows() == 4 ? makeTet(corners) : makeHex(corners);
}

void spreadWeights(const Eigen::Matrix<double, 1, 8>& share, ReferenceElement* r) {
  double spread = 0.0;
  for (int q = 0; q < 8; ++q) spread += r->weight[q] * share[q];
  for (int q = 0; q < 8; ++q) r->weight[q] *= share[q] * r->volume / spread;
  for (int m = 0; m < kModes; ++m) {
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    for (int q = 0; q < 8; ++q) mean += r->weight[q] / r->volume * r->mode[q][m];
    for (int q = 0; q < 8; ++q) r->mode[q][m] -= mean;
  }
}

Eigen::MatrixXd unitMass(const CornerMatrix& X) {
  if (X.rows() == 4) {
    const Eigen::Matrix4d pattern = Eigen::Matrix4d::Ones() + Eigen::Matrix4d::Identity();
    return makeReferenceElement(X).volume / 20.0 * pattern;
  }
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(8, 8);
  for (int q = 0; q < 8; ++q) {
    const Eigen::Matrix<double, 8, 1> N = hexShape(gaussPoint(q));
    const Eigen::Matrix3d J = X.transpose() * hexShapeDerivative(gaussPoint(q));
    M += J.determinant() * N * N.transpose();
  }
  return M;
}

}  // namespace calipso::fem
