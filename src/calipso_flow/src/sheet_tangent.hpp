#pragma once

#include <calipso_fem/world/wind.hpp>

#include "sheet_step.hpp"

namespace calipso::flow {

using Slopes = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic,
                             Eigen::RowMajor>;  // one column per parameter

// How the forces of fem::windForces change with wind, shape and velocity of the surface:
//   dF = dF/dw dw + dF/dx dx + dF/du du
// @param dx, du  3 #V x P
// @param dw      3 x P
Slopes windForceSlopes(const Eigen::VectorXd& x, const Eigen::VectorXd& u,
                       const fem::Triangles& triangles, const fem::Air& air, double areal_density,
                       double h, const Slopes& dx, const Slopes& du, const Slopes& dw);

// Derivatives of a body's motion, carried along with its steps:
//   A dx1 = M (dx0 / h^2 + dv0 / h) + D dx0 / h + dF,
// with the step's own matrices. NOTE: how D changes with x0 is left out.
class MotionTangent {
 public:
  // Nothing depends on the parameters at first.
  MotionTangent(int components, int parameters);

  const Slopes& positions() const { return dx_; }  // 3 #N x P
  const Slopes& velocities() const { return dv_; }
  // @param moved  x1 - x0 of the step just made, 3 #N
  // @param dF     of external less elastic forces at the same positions, 3 #N x P
  // @param viscosity  relative change of D, P
  void advance(const SheetStep& step, const fem::Vec& moved, double h, const Slopes& dF,
               const Eigen::VectorXd& viscosity);

 private:
  Slopes dx_, dv_;
};

}  // namespace calipso::flow
