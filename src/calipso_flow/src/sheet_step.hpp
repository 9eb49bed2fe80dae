#pragma once

#include <Eigen/SparseCholesky>
#include <calipso_fem/deformable_body.hpp>
#include <vector>

namespace calipso::flow {

// Steps of a body by backward Euler with lumped masses,
//   M (x1 - x0 - h v0) / h^2 + D(x0) (x1 - x0) / h + f(x1) = F,
// by Newton's method with one factor per step,
//   A = M / h^2 + D / h + K(x),
// at the positions that the last steps lead to; it is taken anew only where it does not do.
// NOTE: in A, D is that of one of the last few steps.
class SheetStep {
 public:
  // @pre which nodes are fixed stays
  explicit SheetStep(fem::DeformableBody& body);

  // What comes has nothing to do with the steps so far.
  void restart() { age_ = 0; }
  // To the positions in which the forces balance: body.trialPositions(). The body stays in the
  // step, for what depends on it, until body.endStep().
  // @param tolerance  residual over loads and inner forces
  void advance(double h, double tolerance);

  const Eigen::VectorXd& mass() const { return mass_; }  // 3 #N, kg
  const fem::BlockMatrix& viscosity() const { return D_; }
  // A^-1 B, zero where the body is fixed. @param B  3 #N x P
  Eigen::MatrixXd solve(const Eigen::Ref<const Eigen::MatrixXd>& B) const;

 private:
  bool factorise(double h, fem::Definiteness definiteness);  // false: not positive definite
  // Newton's steps with the factor as it is. @return whether the forces balance
  bool iterate(double tolerance);

  fem::DeformableBody& body_;
  Eigen::VectorXd mass_;
  std::vector<int> free_;          // components that are not fixed
  std::vector<int> slots_;         // where in A_ each entry of the blocks goes, -1: nowhere
  Eigen::SparseMatrix<double> A_;  // of the free components, lower half
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
  fem::BlockMatrix K_, D_;
  int age_ = 0;  // of D_, steps; 0: not known yet
};

}  // namespace calipso::flow
