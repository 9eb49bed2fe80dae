#include "material_split.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace calipso::fem {
namespace {

using Eigen::Matrix3d;
using Vector9d = Eigen::Matrix<double, 9, 1>;

Vector9d vec(const Matrix3d& A) { return Eigen::Map<const Vector9d>(A.data()); }

Matrix3d cofactor(const Matrix3d& F) {
  Matrix3d C;
  C.col(0) = F.col(1).cross(F.col(2));
  C.col(1) = F.col(2).cross(F.col(0));
  C.col(2) = F.col(0).cross(F.col(1));
  return C;
}

Matrix3d crossMatrix(const Eigen::Vector3d& a) {
  Matrix3d A;
  A << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return A;
}

// Second derivative of det F.
Matrix9d cofactorDerivative(const Matrix3d& F) {
  Matrix9d D = Matrix9d::Zero();
  for (int c = 0; c < 3; ++c) {
    const int n = (c + 1) % 3, p = (c + 2) % 3;
    D.block<3, 3>(3 * c, 3 * n) = -crossMatrix(F.col(p));
    D.block<3, 3>(3 * c, 3 * p) = crossMatrix(F.col(n));
  }
  return D;
}

// Maps vec(A) to vec((A + A^T) / 2).
Matrix9d symmetrizer() {
  Matrix9d S = Matrix9d::Zero();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      S(3 * j + i, 3 * j + i) += 0.5;
      S(3 * j + i, 3 * i + j) += 0.5;
    }
  return S;
}

MaterialSplit linear(const Lame& lame, const Matrix3d& F) {
  MaterialSplit s;
  const Matrix3d eps = 0.5 * (F + F.transpose()) - Matrix3d::Identity();
  s.kappa = lame.lambda;
  s.psi = lame.mu * eps.squaredNorm();
  s.P = 2.0 * lame.mu * eps;
  s.H = 2.0 * lame.mu * symmetrizer();
  s.g = eps.trace();
  s.dg.setIdentity();
  s.ddg.setZero();
  return s;
}

// dP_ij / dF_kl = 2 mu delta_ik E_lj + mu (F F^T)_ik delta_lj + mu F_il F_kj
Matrix9d stvkShapeTangent(double mu, const Matrix3d& F, const Matrix3d& E) {
  Matrix9d H;
  const Matrix3d B = F * F.transpose();
  for (int j = 0; j < 3; ++j)
    for (int l = 0; l < 3; ++l) {
      Matrix3d block = mu * F.col(l) * F.col(j).transpose();
      block.diagonal().array() += 2.0 * mu * E(l, j);
      if (j == l) block += mu * B;
      H.block<3, 3>(3 * j, 3 * l) = block;
    }
  return H;
}

MaterialSplit stVenantKirchhoff(const Lame& lame, const Matrix3d& F, int derivatives) {
  MaterialSplit s;
  const Matrix3d E = 0.5 * (F.transpose() * F - Matrix3d::Identity());
  s.kappa = lame.lambda;
  s.psi = lame.mu * E.squaredNorm();
  s.g = E.trace();
  s.P = 2.0 * lame.mu * F * E;
  s.dg = F;
  if (derivatives < 2) return s;
  s.H = stvkShapeTangent(lame.mu, F, E);
  s.ddg.setIdentity();
  return s;
}

// Volume term kappa/2 (J - alpha)^2 of both neo-Hookean forms.
void addVolumeTerm(double kappa, double alpha, const Matrix3d& F, int derivatives,
                   MaterialSplit* s) {
  s->kappa = kappa;
  s->g = F.determinant() - alpha;
  s->dg = cofactor(F);
  if (derivatives == 2) s->ddg = cofactorDerivative(F);
}

MaterialSplit stableNeoHookean(const Lame& lame, const Matrix3d& F, int derivatives) {
  // Lame parameters that make the rest tangent that of linear elasticity (Smith et al.,
  // section 3.4).
  const double mu = 4.0 / 3.0 * lame.mu;
  const double lambda = lame.lambda + 5.0 / 6.0 * lame.mu;
  const double Ic = F.squaredNorm();
  MaterialSplit s;
  s.psi = 0.5 * mu * (Ic - 3.0) - 0.5 * mu * std::log(Ic + 1.0);
  s.P = mu * (1.0 - 1.0 / (Ic + 1.0)) * F;
  addVolumeTerm(lambda, 1.0 + 0.75 * mu / lambda, F, derivatives, &s);
  if (derivatives < 2) return s;
  const Vector9d f = vec(F);
  s.H = 2.0 * mu / ((Ic + 1.0) * (Ic + 1.0)) * f * f.transpose();
  s.H.diagonal().array() += mu * (1.0 - 1.0 / (Ic + 1.0));
  return s;
}

MaterialSplit stableNeoHookeanNoLog(const Lame& lame, const Matrix3d& F, int derivatives) {
  // -mu (J-1) + kappa/2 (J-1)^2 = kappa/2 (J - 1 - mu/kappa)^2 - mu^2 / (2 kappa)
  const double kappa = lame.lambda + lame.mu;
  MaterialSplit s;
  s.psi = 0.5 * lame.mu * (F.squaredNorm() - 3.0) - 0.5 * lame.mu * lame.mu / kappa;
  s.P = lame.mu * F;
  addVolumeTerm(kappa, 1.0 + lame.mu / kappa, F, derivatives, &s);
  if (derivatives == 2) s.H = lame.mu * Matrix9d::Identity();
  return s;
}

struct SignedSvd {
  Matrix3d U, V;
  Eigen::Vector3d sigma;  // descending; the last is negative where det F < 0
};

SignedSvd signedSvd(const Matrix3d& F) {
  const Eigen::JacobiSVD<Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  SignedSvd s{svd.matrixU(), svd.matrixV(), svd.singularValues()};
  if (s.U.determinant() * s.V.determinant() < 0.0) {
    s.U.col(2) *= -1.0;
    s.sigma[2] *= -1.0;
  }
  return s;
}

// dR/dF = sum over axis pairs of 2 / (sigma_i + sigma_j) t t^T, t = vec(U T V^T) with T the unit
// rotation generator. NOTE: the sum is kept away from zero, where R(F) jumps.
Matrix9d rotationDerivative(const SignedSvd& s) {
  Matrix9d D = Matrix9d::Zero();
  const double floor = 1e-6 * std::max(1e-300, s.sigma[0]);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const Matrix3d T = (s.U.col(i) * s.V.col(j).transpose() - s.U.col(j) * s.V.col(i).transpose()) /
                       std::sqrt(2.0);
    D += 2.0 / std::max(floor, s.sigma[i] + s.sigma[j]) * vec(T) * vec(T).transpose();
  }
  return D;
}

MaterialSplit corotated(const Lame& lame, const Matrix3d& F, int derivatives) {
  const SignedSvd svd = signedSvd(F);
  const Matrix3d R = svd.U * svd.V.transpose();
  MaterialSplit s;
  s.kappa = lame.lambda;
  s.psi = lame.mu * (F - R).squaredNorm();
  s.P = 2.0 * lame.mu * (F - R);
  s.g = svd.sigma.sum() - 3.0;
  s.dg = R;
  if (derivatives < 2) return s;
  s.ddg = rotationDerivative(svd);
  s.H = 2.0 * lame.mu * (Matrix9d::Identity() - s.ddg);
  return s;
}

}  // namespace

Matrix9d MaterialSplit::tangent() const {
  return H + kappa * (vec(dg) * vec(dg).transpose() + g * ddg);
}

MaterialSplit evaluateSplit(MaterialModel model, const Lame& lame, const Matrix3d& F,
                            int derivatives) {
  switch (model) {
    case MaterialModel::kLinear:
      return linear(lame, F);
    case MaterialModel::kStVenantKirchhoff:
      return stVenantKirchhoff(lame, F, derivatives);
    case MaterialModel::kStableNeoHookean:
      return stableNeoHookean(lame, F, derivatives);
    case MaterialModel::kStableNeoHookeanNoLog:
      return stableNeoHookeanNoLog(lame, F, derivatives);
    case MaterialModel::kCorotated:
      return corotated(lame, F, derivatives);
  }
  return linear(lame, F);
}

Matrix9d stvkMaterialTangent(const Lame& lame, const Matrix3d& F) {
  return stvkShapeTangent(lame.mu, F, Matrix3d::Zero()) + lame.lambda * vec(F) * vec(F).transpose();
}

Matrix3d polarRotation(const Matrix3d& F) {
  const SignedSvd svd = signedSvd(F);
  return svd.U * svd.V.transpose();
}

}  // namespace calipso::fem
