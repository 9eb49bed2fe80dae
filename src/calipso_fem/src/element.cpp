#include "element.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace calipso::fem {
namespace {

using Eigen::Matrix3d;

// f_a += w P grad N_a
void addForce(const CornerMatrix& gradient, const Matrix3d& P, double w, ElementVector* f) {
  for (int a = 0; a < gradient.rows(); ++a)
    f->segment<3>(3 * a) += w * (P * gradient.row(a).transpose());
}

void addStandardPoint(const ElementKind& kind, const CornerMatrix& x, int q, int derivatives,
                      Part part, ElementResult* r) {
  const CornerMatrix& G = kind.reference->gradient[q];
  const double w = kind.reference->weight[q];
  const Matrix3d F = x.transpose() * G;
  const MaterialSplit s = evaluateSplit(kind.model, kind.lame, F, derivatives);
  r->energy += w * (s.energy() - restEnergyDensity(kind.model, kind.lame));
  if (derivatives < 1) return;
  addForce(G, s.stress(), w, &r->f);
  if (derivatives < 2) return;
  const Matrix9d H = s.tangent();
  addTangent(G, part == Part::kPositive ? projectPositive(H) : H, w, &r->K);
}

// Mean dilatation: sum w (psi(F) + kappa/2 gbar^2), gbar = sum w g(F) / V.
void evaluateMeanDilatation(const ElementKind& kind, const CornerMatrix& x, int derivatives,
                            Part part, ElementResult* r) {
  const ReferenceElement& ref = *kind.reference;
  std::array<MaterialSplit, kMaxPoints> split;
  ElementVector mean = ElementVector::Zero(3 * ref.corners);  // V dgbar/dx
  double g = 0.0, kappa = 0.0;
  for (int q = 0; q < ref.points; ++q) {
    const Matrix3d F = x.transpose() * ref.gradient[q];
    split[q] = evaluateSplit(kind.model, kind.lame, F, derivatives);
    g += ref.weight[q] * split[q].g / ref.volume;
    kappa = split[q].kappa;
    if (derivatives > 0) addForce(ref.gradient[q], split[q].dg, ref.weight[q], &mean);
  }
  const double rest = restEnergyDensity(kind.model, kind.lame);
  r->energy += ref.volume * (0.5 * kappa * g * g - rest);
  for (int q = 0; q < ref.points; ++q) {
    const MaterialSplit& s = split[q];
    r->energy += ref.weight[q] * s.psi;
    if (derivatives > 0) addForce(ref.gradient[q], s.P, ref.weight[q], &r->f);
    if (derivatives < 2) continue;
    const Matrix9d H = s.H + kappa * g * s.ddg;
    addTangent(ref.gradient[q], part == Part::kPositive ? projectPositive(H) : H, ref.weight[q],
               &r->K);
  }
  if (derivatives > 0) r->f += kappa * g * mean;
  if (derivatives == 2) r->K += kappa / ref.volume * mean * mean.transpose();
}

// Smoothstep from 0 at kRecoveryDilatation to 1 at det F = 0, with its derivatives by det F.
struct Activation {
  double s = 1.0, ds = 0.0, dds = 0.0;
  explicit Activation(double J) {
    const double t = 1.0 - J / kRecoveryDilatation;
    if (t >= 1.0) return;
    s = t * t * (3.0 - 2.0 * t);
    ds = -6.0 * t * (1.0 - t) / kRecoveryDilatation;
    dds = 6.0 * (1.0 - 2.0 * t) / (kRecoveryDilatation * kRecoveryDilatation);
  }
};

// NOTE: St. Venant-Kirchhoff depends on F^T F only, cannot tell an inverted element from a sound
// one, and has no force in a collapsed one. Below J0, far below what it is valid for, kappa/2 (J -
// J0)^2 + s(J) psi_corot pushes it back: the first raises J, the second has a force at any F but a
// rotation.
void addRecovery(const ElementKind& kind, const CornerMatrix& x, int derivatives, Part part,
                 ElementResult* r) {
  const ReferenceElement& ref = *kind.reference;
  const auto outer = [](const Matrix3d& A, const Matrix3d& B) -> Matrix9d {
    return Eigen::Map<const Eigen::Matrix<double, 9, 1>>(A.data()) *
           Eigen::Map<const Eigen::Matrix<double, 1, 9>>(B.data());
  };
  for (int q = 0; q < ref.points; ++q) {
    const Matrix3d F = x.transpose() * ref.gradient[q];
    const double J = F.determinant(), w = ref.weight[q];
    if (J >= kRecoveryDilatation) continue;
    const Lame lame{kind.lame.lambda + 2.0 * kind.lame.mu, 0.0};
    MaterialSplit d = evaluateSplit(MaterialModel::kStableNeoHookeanNoLog, lame, F, derivatives);
    d.g += 1.0 - kRecoveryDilatation;  // J - J0
    const MaterialSplit c = evaluateSplit(MaterialModel::kCorotated, kind.lame, F, derivatives);
    const Activation a(J);
    r->energy += w * (0.5 * d.kappa * d.g * d.g + a.s * c.energy());
    if (derivatives < 1) continue;
    addForce(ref.gradient[q], (d.kappa * d.g + a.ds * c.energy()) * d.dg + a.s * c.stress(), w,
             &r->f);
    if (derivatives < 2) continue;
    const Matrix9d H =
        d.tangent() + a.dds * c.energy() * outer(d.dg, d.dg) + a.ds * c.energy() * d.ddg +
        a.ds * (outer(d.dg, c.stress()) + outer(c.stress(), d.dg)) + a.s * c.tangent();
    addTangent(ref.gradient[q], part == Part::kPositive ? projectPositive(H) : H, w, &r->K);
  }
}

// Sum over points of the enhanced modes' energies at rest: K_ij = sum w m_i : C : m_j.
ModeMatrix restModeStiffness(const ReferenceElement& ref, const Lame& lame) {
  ModeMatrix K = ModeMatrix::Zero();
  for (int q = 0; q < ref.points; ++q) {
    std::array<Matrix3d, kModes> e;
    for (int i = 0; i < kModes; ++i) e[i] = 0.5 * (ref.mode[q][i] + ref.mode[q][i].transpose());
    for (int i = 0; i < kModes; ++i)
      for (int j = 0; j < kModes; ++j)
        K(i, j) += ref.weight[q] * (2.0 * lame.mu * e[i].cwiseProduct(e[j]).sum() +
                                    lame.lambda * e[i].trace() * e[j].trace());
  }
  return K;
}

}  // namespace

void addTangent(const CornerMatrix& G, const Matrix9d& H, double w, ElementMatrix* K) {
  const int n = static_cast<int>(G.rows());
  for (int b = 0; b < n; ++b) {
    Eigen::Matrix<double, 9, 3> HB;  // dP per displacement of corner b
    HB.noalias() =
        H.middleCols<3>(0) * G(b, 0) + H.middleCols<3>(3) * G(b, 1) + H.middleCols<3>(6) * G(b, 2);
    for (int a = 0; a < n; ++a)
      K->block<3, 3>(3 * a, 3 * b) +=
          w * (HB.middleRows<3>(0) * G(a, 0) + HB.middleRows<3>(3) * G(a, 1) +
               HB.middleRows<3>(6) * G(a, 2));
  }
}

ElementKind makeElementKind(const ReferenceElement& reference, ElementType type,
                            MaterialModel model, const Lame& lame) {
  ElementKind kind;
  kind.reference = &reference;
  kind.type = type;
  kind.model = model;
  kind.lame = lame;
  if (type == ElementType::kHexEnhanced) {
    kind.mode_stiffness = restModeStiffness(reference, lame);
    kind.mode_stiffness_inverse =
        kind.mode_stiffness.topLeftCorner<kGradientModes, kGradientModes>().ldlt().solve(
            GradientModeMatrix::Identity());
  }
  return kind;
}

void evaluateElement(const ElementKind& kind, const CornerMatrix& x, int derivatives, Part part,
                     ElementResult* r) {
  const int dofs = 3 * kind.reference->corners;
  r->energy = 0.0;
  if (derivatives > 0) r->f.setZero(dofs);
  if (derivatives > 1) r->K.setZero(dofs, dofs);
  const bool stvk = kind.model == MaterialModel::kStVenantKirchhoff;
  if (kind.type == ElementType::kHexEnhanced) {
    if (stvk)
      evaluateEnhancedStvk(kind, x, derivatives, part, r);
    else
      evaluateEnhanced(kind, x, derivatives, part, r);
  } else if (stvk && part == Part::kMaterialOnly) {
    for (int q = 0; q < kind.reference->points; ++q) {
      const Matrix3d F = x.transpose() * kind.reference->gradient[q];
      addTangent(kind.reference->gradient[q], stvkMaterialTangent(kind.lame, F),
                 kind.reference->weight[q], &r->K);
    }
  } else if (kind.type == ElementType::kHexMeanDilatation) {
    evaluateMeanDilatation(kind, x, derivatives, part, r);
  } else {
    for (int q = 0; q < kind.reference->points; ++q)
      addStandardPoint(kind, x, q, derivatives, part, r);
  }
  if (stvk && part != Part::kMaterialOnly) addRecovery(kind, x, derivatives, part, r);
}

}  // namespace calipso::fem
