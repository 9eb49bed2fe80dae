#pragma once

#include <memory>
#include <vector>

#include "calipso_fem/fem_options.hpp"
#include "calipso_scene/material.hpp"
#include "preconditioner.hpp"

namespace calipso::fem {

// times the first residual or the right side: one that grows so far belongs to loads that nothing
// holds.
constexpr double kRunaway = 1e6;

struct SolveReport {
  bool positive = true;  // false: A has shown to be singular, or to have negative curvature
  bool preconditioner_positive = true;
  bool converged = false;
  int iterations = 0;
  double residual = 0.0;  // |b - A x| / |b|
};

// Preconditioned conjugate gradients for A x = b, A symmetric. x is the start value on entry.
SolveReport conjugateGradients(const BlockMatrix& A, Preconditioner& preconditioner, const Vec& b,
                               double tolerance, int most_iterations, Vec* x);

// Whether coarse grids see what matters: not where stiff and soft cells lie side by side, nor where
// the material hardly changes its volume.
bool suitsMultigrid(const std::vector<Material>& materials);
// Whether a Cholesky factor costs no more than some twenty iterations of multigrid.
bool hasSmallFactor(const VolumeMesh& mesh);
// What automatic means where every solver works on an assembled matrix.
SolverKind chooseSolverKind(const VolumeMesh& mesh, const std::vector<Material>& materials);

// Solves a sequence of slowly changing systems on one pattern; chooses and refreshes the
// preconditioner.
class LinearSolver {
 public:
  // kind: not automatic
  LinearSolver(const VolumeMesh& mesh, SolverKind kind);

  // @pre A stays unchanged until the last solve() with it
  bool setMatrix(const BlockMatrix& A, bool positive = false);
  SolveReport solve(const Vec& b, double tolerance, int most_iterations, Vec* x);
  SolverKind kind() const { return kind_; }
  // The next setMatrix() rebuilds the preconditioner whatever its age.
  void invalidate() { stale_ = true; }

 private:
  bool refresh();

  SolverKind kind_;
  std::unique_ptr<Preconditioner> preconditioner_;
  const BlockMatrix* A_ = nullptr;
  bool positive_ = false;     // A is known to be positive definite
  bool stale_ = true;         // nothing usable in the preconditioner
  bool current_ = false;      // the preconditioner belongs to A_
  int fresh_iterations_ = 0;  // CG iterations of the first solve after the last refresh
  int last_iterations_ = 0;
};

}  // namespace calipso::fem
