#pragma once

#include <Eigen/Core>
#include <array>

namespace calipso::fem {

constexpr int kMaxCorners = 8;
constexpr int kMaxPoints = 8;
constexpr int kModes = 12;
constexpr int kGradientModes = 9;  // the first of them

using CornerMatrix = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor, kMaxCorners, 3>;

// What depends on a cell's rest shape alone; shared by cells of equal shape.
struct ReferenceElement {
  int corners = 0;                                // 8 or 4
  int points = 0;                                 // Gauss points: 8 or 1
  double volume = 0.0;                            // m^3, as if filled
  std::array<double, kMaxPoints> weight{};        // m^3
  std::array<CornerMatrix, kMaxPoints> gradient;  // dN_a/dX, corners x 3, 1/m
  CornerMatrix center_gradient;                   // at the cell's centre
  // Enhanced gradient modes (Simo and Rifai 1990; Simo and Armero 1992): the gradients of
  // Wilson's bubbles 1 - xi_k^2, mapped with the centre's Jacobian so that the patch test holds:
  // mode 3 k + c at a point is xi_k (j0/j) e_c (x) J0^-T e_k. Three more change the volume only,
  // xi_0 xi_1, xi_1 xi_2 and xi_2 xi_0 times (j0/j) I: against locking near nu = 0.5 (Simo, Armero
  // and Taylor 1993).
  std::array<std::array<Eigen::Matrix3d, kModes>, kMaxPoints> mode;
};

// Shape functions of the trilinear hexahedron at parent coordinates xi in [-1, 1]^3, and
// derivatives.
Eigen::Matrix<double, 8, 1> hexShape(const Eigen::Vector3d& xi);
Eigen::Matrix<double, 8, 3> hexShapeDerivative(const Eigen::Vector3d& xi);

// Parent coordinates of Gauss point q of the 2x2x2 rule; all weights are one.
Eigen::Vector3d gaussPoint(int q);

// @throw std::invalid_argument when the cell is inverted or has no volume
ReferenceElement makeReferenceElement(const CornerMatrix& corners);

// Spreads the weights over the Gauss points of a hexahedron by `share` (mean one), and shifts the
// modes so that they still do no work on constant stress (patch test).
void spreadWeights(const Eigen::Matrix<double, 1, 8>& share, ReferenceElement* reference);

// Mass matrix of a unit density between corners (row-major, corners x corners), m^3.
Eigen::MatrixXd unitMass(const CornerMatrix& corners);

}  // namespace calipso::fem
