#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "element.hpp"

// Hexahedra with enhanced strains, condensed in the element.
//  a      mode amplitudes
//  K_aa   d2W/da2,  K_xa  d2W/dx da,  K = K_xx - K_xa K_aa^-1 K_ax
namespace calipso::fem {
namespace {

using Eigen::Matrix3d;
using ModeVector = Eigen::Matrix<double, kModes, 1>;
using Coupling = Eigen::Matrix<double, kMaxDof, kModes>;
using GradientModeVector = Eigen::Matrix<double, kGradientModes, 1>;
using GradientCoupling = Eigen::Matrix<double, kMaxDof, kGradientModes>;

Matrix3d symmetric(const Matrix3d& A) { return 0.5 * (A + A.transpose()); }

// S = 2 mu E + lambda tr(E) I
Matrix3d hooke(const Lame& lame, const Matrix3d& E) {
  return 2.0 * lame.mu * E + lame.lambda * E.trace() * Matrix3d::Identity();
}

Matrix3d positivePart(const Matrix3d& S) {
  Eigen::SelfAdjointEigenSolver<Matrix3d> eigen;
  eigen.computeDirect(S);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
         eigen.eigenvectors().transpose();
}

// F = x^T G with gradients G that contain the modes: F_q + F_0 sum_i a_i m_iq (F_0: the centre's).
// NOTE: linear elasticity takes F_0 = I, so that it stays linear.
struct EnhancedPoint {
  CornerMatrix gradient;
  Matrix3d F;
};

EnhancedPoint enhancedPoint(const ElementKind& kind, const CornerMatrix& x, int q,
                            const ModeVector& a) {
  const ReferenceElement& ref = *kind.reference;
  Matrix3d M = Matrix3d::Zero();
  for (int i = 0; i < kModes; ++i) M += a[i] * ref.mode[q][i];
  EnhancedPoint p;
  p.gradient = ref.gradient[q];
  if (kind.model == MaterialModel::kLinear) {
    p.F = x.transpose() * p.gradient + M;
  } else {
    p.gradient += ref.center_gradient * M;
    p.F = x.transpose() * p.gradient;
  }
  return p;
}

Matrix3d centerGradient(const ElementKind& kind, const CornerMatrix& x) {
  if (kind.model == MaterialModel::kLinear) return Matrix3d::Identity();
  return x.transpose() * kind.reference->center_gradient;
}

// Keeps K_aa regular where F_0 is singular; far below what any result can show.
constexpr double kModeRegularization = 1e-9;

double modeEnergy(const ElementKind& kind, const CornerMatrix& x, const ModeVector& a) {
  double energy = 0.5 * kModeRegularization * a.dot(kind.mode_stiffness * a);
  for (int q = 0; q < kind.reference->points; ++q)
    energy += kind.reference->weight[q] *
              (energyDensity(kind.model, kind.lame, enhancedPoint(kind, x, q, a).F) -
               restEnergyDensity(kind.model, kind.lame));
  return energy;
}

struct ModeSystem {
  ModeVector gradient;
  ModeMatrix K;
};

ModeSystem modeSystem(const ElementKind& kind, const CornerMatrix& x, const ModeVector& a,
                      bool positive) {
  const Matrix3d F0 = centerGradient(kind, x);
  ModeSystem s{kModeRegularization * kind.mode_stiffness * a,
               kModeRegularization * kind.mode_stiffness};
  for (int q = 0; q < kind.reference->points; ++q) {
    const double w = kind.reference->weight[q];
    const MaterialSplit split =
        evaluateSplit(kind.model, kind.lame, enhancedPoint(kind, x, q, a).F, 2);
    const Matrix3d P = split.stress();
    const Matrix9d H = positive ? projectPositive(split.tangent()) : split.tangent();
    Eigen::Matrix<double, 9, kModes> D;  // dF/da
    for (int i = 0; i < kModes; ++i) {
      const Matrix3d d = F0 * kind.reference->mode[q][i];
      D.col(i) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(d.data());
    }
    s.gradient += w * D.transpose() * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(P.data());
    s.K += w * D.transpose() * H * D;
  }
  return s;
}

// Amplitudes that minimise the element's energy at corners x: damped Newton from zero.
ModeVector solveModes(const ElementKind& kind, const CornerMatrix& x) {
  constexpr int kMaxIterations = 200;
  constexpr double kExact = 1e-11, kSmall = 1e-5;  // of an amplitude
  ModeVector a = ModeVector::Zero();
  double energy = modeEnergy(kind, x, a);
  for (int it = 0; it < kMaxIterations; ++it) {
    ModeSystem s = modeSystem(kind, x, a, false);
    Eigen::LLT<ModeMatrix> llt(s.K);
    if (llt.info() != Eigen::Success) {
      s = modeSystem(kind, x, a, true);
      llt.compute(s.K);
    }
    const ModeVector step = -llt.solve(s.gradient);
    const double largest = step.lpNorm<Eigen::Infinity>();
    if (!std::isfinite(largest)) break;
    // Near the minimum the energy's own rounding would mislead a line search.
    if (largest < kSmall) {
      a += step;
      if (largest < kExact) break;
      continue;
    }
    const double slope = s.gradient.dot(step), noise = 1e-14 * std::abs(energy);
    double t = 1.0, trial = modeEnergy(kind, x, a + step);
    while (!(trial <= energy + 1e-4 * t * slope + noise) && t > 1e-6)
      trial = modeEnergy(kind, x, a + (t *= 0.5) * step);
    if (!(trial <= energy + noise)) break;
    a += t * step;
    energy = trial;
  }
  return a;
}

}  // namespace

// NOTE: the modes are added to the Green strain, E_q + sum_i a_i sym(m_iq), not to F. W is then
// quadratic in a with a constant K_aa: the condensation is exact, needs no inner iteration, and the
// condensed energy is a non-negative quadratic form of the Green strains.
void evaluateEnhancedStvk(const ElementKind& kind, const CornerMatrix& x, int derivatives,
                          Part part, ElementResult* r) {
  const ReferenceElement& ref = *kind.reference;
  std::array<Matrix3d, kMaxPoints> F, E;
  GradientModeVector load = GradientModeVector::Zero();
  for (int q = 0; q < ref.points; ++q) {
    F[q] = x.transpose() * ref.gradient[q];
    E[q] = 0.5 * (F[q].transpose() * F[q] - Matrix3d::Identity());
    const Matrix3d S = ref.weight[q] * hooke(kind.lame, E[q]);
    for (int i = 0; i < kGradientModes; ++i) load[i] += S.cwiseProduct(ref.mode[q][i]).sum();
  }
  const GradientModeVector a = -kind.mode_stiffness_inverse * load;

  GradientCoupling C = GradientCoupling::Zero();  // K_xa
  for (int q = 0; q < ref.points; ++q) {
    const double w = ref.weight[q];
    Matrix3d enhanced = E[q];
    for (int i = 0; i < kGradientModes; ++i) enhanced += a[i] * symmetric(ref.mode[q][i]);
    const Matrix3d S = hooke(kind.lame, enhanced);
    r->energy += 0.5 * w * S.cwiseProduct(enhanced).sum();
    if (derivatives < 1) continue;
    for (int c = 0; c < ref.corners; ++c)
      r->f.segment<3>(3 * c) += w * (F[q] * (S * ref.gradient[q].row(c).transpose()));
    if (derivatives < 2) continue;
    const Matrix3d geometric = part == Part::kMaterialOnly ? Matrix3d(Matrix3d::Zero())
                               : part == Part::kPositive   ? positivePart(S)
                                                           : S;
    // p_a = F grad N_a;  K_ab = lambda p_a p_b^T + mu p_b p_a^T + mu (g_a.g_b) F F^T + (g_a.S g_b)
    // I
    const CornerMatrix& G = ref.gradient[q];
    const CornerMatrix p = G * F[q].transpose();
    const Matrix3d B = F[q] * F[q].transpose();
    const auto GG = (G * G.transpose()).eval();
    const auto GSG = (G * geometric * G.transpose()).eval();
    for (int i = 0; i < ref.corners; ++i)
      for (int j = 0; j < ref.corners; ++j) {
        auto K = r->K.block<3, 3>(3 * i, 3 * j);
        K += w * kind.lame.lambda * p.row(i).transpose() * p.row(j) +
             w * kind.lame.mu * (p.row(j).transpose() * p.row(i) + GG(i, j) * B);
        K.diagonal().array() += w * GSG(i, j);
      }
    for (int m = 0; m < kGradientModes; ++m) {
      const Matrix3d T = w * hooke(kind.lame, symmetric(ref.mode[q][m]));
      for (int c = 0; c < ref.corners; ++c)
        C.block<3, 1>(3 * c, m) += F[q] * (T * G.row(c).transpose());
    }
  }
  if (derivatives == 2) r->K -= C * kind.mode_stiffness_inverse * C.transpose();
}

void evaluateEnhanced(const ElementKind& kind, const CornerMatrix& x, int derivatives, Part part,
                      ElementResult* r) {
  const ReferenceElement& ref = *kind.reference;
  const bool positive = part == Part::kPositive;
  const ModeVector a = solveModes(kind, x);
  r->energy += modeEnergy(kind, x, a);
  if (derivatives < 1) return;
  const Matrix3d F0 = centerGradient(kind, x);
  const bool linear = kind.model == MaterialModel::kLinear;
  Coupling C = Coupling::Zero();
  for (int q = 0; q < ref.points; ++q) {
    const double w = ref.weight[q];
    const EnhancedPoint p = enhancedPoint(kind, x, q, a);
    const MaterialSplit split = evaluateSplit(kind.model, kind.lame, p.F, derivatives);
    const Matrix3d P = split.stress();
    for (int c = 0; c < ref.corners; ++c)
      r->f.segment<3>(3 * c) += w * (P * p.gradient.row(c).transpose());
    if (derivatives < 2) continue;
    const Matrix9d H = positive ? projectPositive(split.tangent()) : split.tangent();
    addTangent(p.gradient, H, w, &r->K);
    for (int i = 0; i < kModes; ++i) {
      const Matrix3d dF = F0 * ref.mode[q][i];
      Matrix3d dP;
      Eigen::Map<Eigen::Matrix<double, 9, 1>>(dP.data()) =
          w * H * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(dF.data());
      Eigen::Matrix<double, 3, kMaxCorners> force = dP * p.gradient.transpose();
      // The stress acts through dG/da; left out of a positive tangent.
      if (!linear && !positive)
        force += w * P * ref.mode[q][i].transpose() * ref.center_gradient.transpose();
      C.col(i) += Eigen::Map<const Eigen::Matrix<double, kMaxDof, 1>>(force.data());
    }
  }
  if (derivatives == 2) {
    const ModeMatrix K_aa = modeSystem(kind, x, a, positive).K;
    r->K -= C * K_aa.ldlt().solve(C.transpose());
  }
}

}  // namespace calipso::fem
