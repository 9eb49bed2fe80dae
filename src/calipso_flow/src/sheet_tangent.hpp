#pragma once

#include <Eigen/SparseCholesky>
#include <calipso_fem/deformable_body.hpp>
#include <calipso_fem/world/wind.hpp>
#include <vector>

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

// Derivatives of a body's motion, carried along with its steps by backward Euler:
//   M (x1 - x0 - h v0) / h^2 + D(x0) (x1 - x0) / h + f(x1) = F(x0, v0)
//   A dx1 = M (dx0 / h^2 + dv0 / h) + D dx0 / h + dF,    A = M / h^2 + D / h + K(x1)
// NOTE: how D changes with x0 is left out; D is a small part of A.
class MotionTangent {
 public:
  // Nothing depends on the parameters at first. @pre steps of the body are by backward Euler with
  // lumped masses
  MotionTangent(const fem::DeformableBody& body, int parameters);

  const Slopes& positions() const { return dx_; }  // 3 #N x P
  const Slopes& velocities() const { return dv_; }
  // The body has just gone from x0 to its present state within h.
  // @param dF  of external less elastic forces at the same positions, 3 #N x P
  // @param viscosity  relative change of D, P
  void advance(const fem::Vec& x0, double h, const Slopes& dF, const Eigen::VectorXd& viscosity);

 private:
  void factorise(const fem::Vec& x0, double h);

  const fem::DeformableBody& body_;
  Eigen::VectorXd mass_;           // 3 #N, kg
  std::vector<int> free_;          // components that are not fixed
  std::vector<int> slots_;         // where in values_ each entry of the blocks goes, -1: nowhere
  Eigen::SparseMatrix<double> A_;  // of the free components, lower half
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
  fem::BlockMatrix K_, D_;
  Slopes dx_, dv_;
};

}  // namespace calipso::flow
