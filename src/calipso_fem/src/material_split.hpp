#pragma once

#include "calipso_fem/material_model.hpp"

namespace calipso::fem {

// Psi(F) = psi(F) + kappa/2 g(F)^2: a shape part and a dilatation part, so that the dilatation
// measure g can be averaged over an element. P and H belong to psi, dg and ddg to g.
struct MaterialSplit {
  double psi = 0.0, kappa = 0.0, g = 0.0;
  Eigen::Matrix3d P, dg;
  Matrix9d H, ddg;

  double energy() const { return psi + 0.5 * kappa * g * g; }
  Eigen::Matrix3d stress() const { return P + kappa * g * dg; }
  Matrix9d tangent() const;
};

// derivatives: 0 energy only, 1 also P and dg, 2 also H and ddg.
MaterialSplit evaluateSplit(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F,
                            int derivatives);

// Tangent of St. Venant-Kirchhoff at zero stress, pulled forward by F: positive semi-definite.
Matrix9d stvkMaterialTangent(const Lame& lame, const Eigen::Matrix3d& F);

}  // namespace calipso::fem
