#pragma once

#include <Eigen/Core>

#include "calipso_fem/elastic_model.hpp"
#include "material_split.hpp"
#include "reference_element.hpp"

namespace calipso::fem {

constexpr int kMaxDof = 3 * kMaxCorners;
using ElementVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDof, 1>;
using ElementMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDof, kMaxDof>;
using ModeMatrix = Eigen::Matrix<double, kModes, kModes>;
using GradientModeMatrix = Eigen::Matrix<double, kGradientModes, kGradientModes>;

// What cells of equal shape and equal elastic constants share.
struct ElementKind {
  const ReferenceElement* reference = nullptr;
  ElementType type = ElementType::kHexQ1;
  MaterialModel model = MaterialModel::kStVenantKirchhoff;
  Lame lame;
  ModeMatrix mode_stiffness;  // K_aa at rest (enhanced elements only)
  // St. Venant-Kirchhoff: inverse for the modes it uses, the gradient modes. NOTE: the volumetric
  // ones would cost it an eighth of its time, for 0.04 % of the error at nu = 0.3.
  GradientModeMatrix mode_stiffness_inverse;
};

ElementKind makeElementKind(const ReferenceElement& reference, ElementType type,
                            MaterialModel model, const Lame& lame);

struct ElementResult {
  double energy = 0.0;
  ElementVector f;  // corners x 3, node by node
  ElementMatrix K;
};

enum class Part { kFull, kPositive, kMaterialOnly };

// Energy (zero at rest), force and, with derivatives == 2, stiffness of one filled cell whose
// corners are at x (corners x 3, m). Part: the whole tangent, a positive semi-definite one, or
// (StVK elements) the part without geometric stiffness.
void evaluateElement(const ElementKind& kind, const CornerMatrix& x, int derivatives, Part part,
                     ElementResult* result);

// The same of enhanced hexahedra.
void evaluateEnhancedStvk(const ElementKind& kind, const CornerMatrix& x, int derivatives,
                          Part part, ElementResult* result);
void evaluateEnhanced(const ElementKind& kind, const CornerMatrix& x, int derivatives, Part part,
                      ElementResult* result);

// K += w sum_ab  dP/dF : (grad N_a (x) grad N_b)
void addTangent(const CornerMatrix& gradient, const Matrix9d& H, double w, ElementMatrix* K);

// Below this det F, St. Venant-Kirchhoff elements are pushed back by an added dilatation energy.
constexpr double kRecoveryDilatation = 0.1;

}  // namespace calipso::fem
