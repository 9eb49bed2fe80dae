#include "linear_solver.hpp"

#include <algorithm>
#include <cmath>

#include "multigrid.hpp"

namespace calipso::fem {
namespace {

// Node counts up to which the choice was measured best; see the report.
constexpr int kStaleCholeskyNodes = 1200;
constexpr int kHardCholeskyNodes = 20000;  // where multigrid would need many iterations
constexpr int kSolidFactorNodes = 1500,
              kSheetFactorNodes = 8000;     // the same once multigrid has proved slow
constexpr double kMultigridContrast = 1e3;  // largest over smallest Young's modulus
constexpr double kMultigridPoisson = 0.495;

std::unique_ptr<Preconditioner> makePreconditioner(const VolumeMesh& mesh, SolverKind kind) {
  switch (kind) {
    case SolverKind::kJacobi:
      return makeJacobi();
    case SolverKind::kIncompleteCholesky:
      return makeIncompleteCholesky();
    case SolverKind::kMultigrid:
      return makeMultigrid(mesh);
    default:
      return makeCholesky();
  }
}

// A stale preconditioner is renewed once it costs this many times the iterations of a fresh one.
constexpr double kStaleFactor = 1.6;
constexpr int kStaleSlack = 4;

}  // namespace

bool suitsMultigrid(const std::vector<Material>& materials) {
  double least = materials.front().youngs_modulus, largest = least, poisson = 0.0;
  for (const Material& m : materials) {
    least = std::min(least, m.youngs_modulus);
    largest = std::max(largest, m.youngs_modulus);
    poisson = std::max(poisson, m.poissons_ratio);
  }
  return largest <= kMultigridContrast * least && poisson <= kMultigridPoisson;
}

bool hasSmallFactor(const VolumeMesh& mesh) {
  std::vector<int> cells(mesh.nodeCount(), 0);
  for (Eigen::Index c = 0; c < mesh.cells.rows(); ++c)
    for (Eigen::Index k = 0; k < mesh.cells.cols(); ++k) ++cells[mesh.cells(c, k)];
  // Of a sheet no node lies inside; its factor grows far more slowly.
  const bool sheet = std::none_of(cells.begin(), cells.end(), [](int n) { return n >= 8; });
  return mesh.nodeCount() <= (sheet ? kSheetFactorNodes : kSolidFactorNodes);
}

SolverKind chooseSolverKind(const VolumeMesh& mesh, const std::vector<Material>& materials) {
  const int most = suitsMultigrid(materials) ? kStaleCholeskyNodes : kHardCholeskyNodes;
  if (mesh.nodeCount() <= most) return SolverKind::kStaleCholesky;
  return mesh.lattice.rows() > 0 ? SolverKind::kMultigrid : SolverKind::kIncompleteCholesky;
}

SolveReport conjugateGradients(const BlockMatrix& A, Preconditioner& preconditioner, const Vec& b,
                               double tolerance, int most_iterations, Vec* x) {
  SolveReport report;
  const double scale = b.norm();
  Vec r, z, p, Ap;
  A.multiply(*x, Ap);
  r = b - Ap;
  const double first = r.norm();
  double residual = first;
  double rz = 0.0;
  for (; report.iterations < most_iterations; ++report.iterations) {
    if (residual <= tolerance * scale) break;
    preconditioner.apply(r, z);
    const double rz_next = r.dot(z);
    p = report.iterations == 0 ? z : Vec(z + rz_next / rz * p);
    rz = rz_next;
    A.multiply(p, Ap);
    const double curvature = p.dot(Ap);
    if (!(curvature > 0.0) || !(rz > 0.0)) {
      report.positive = false;
      report.preconditioner_positive = rz > 0.0;
      break;
    }
    const double step = rz / curvature;
    *x += step * p;
    r -= step * Ap;
    residual = r.norm();
    report.positive = residual < kRunaway * std::max(first, scale);
    if (!report.positive) break;
  }
  report.residual = scale > 0.0 ? residual / scale : residual;
  report.converged = report.positive && residual <= tolerance * scale;
  return report;
}

LinearSolver::LinearSolver(const VolumeMesh& mesh, SolverKind kind)
    : kind_(kind), preconditioner_(makePreconditioner(mesh, kind_)) {}

bool LinearSolver::refresh() {
  if (!preconditioner_->update(*A_)) {
    stale_ = true;
    return false;
  }
  stale_ = false;
  current_ = true;
  fresh_iterations_ = last_iterations_ = 0;
  return true;
}

bool LinearSolver::setMatrix(const BlockMatrix& A, bool positive) {
  A_ = &A;
  positive_ = positive;
  current_ = false;
  const bool keeps = kind_ == SolverKind::kStaleCholesky || kind_ == SolverKind::kMultigrid;
  const bool worn = last_iterations_ > kStaleFactor * fresh_iterations_ + kStaleSlack;
  return keeps && !stale_ && !worn ? true : refresh();
}

SolveReport LinearSolver::solve(const Vec& b, double tolerance, int most_iterations, Vec* x) {
  if (current_ && preconditioner_->isExact()) {
    preconditioner_->apply(b, *x);
    SolveReport exact;
    exact.converged = true;
    return exact;
  }
  SolveReport report = conjugateGradients(*A_, *preconditioner_, b, tolerance, most_iterations, x);
  last_iterations_ = report.iterations;
  if (fresh_iterations_ == 0) fresh_iterations_ = std::max(1, report.iterations);
  // A worn preconditioner can make CG stall; a fresh one gets a second chance.
  if (!report.converged && !current_ && refresh()) {
    x->setZero();
    return solve(b, tolerance, most_iterations, x);
  }
  if (!report.preconditioner_positive && positive_ && preconditioner_->widen()) {
    stale_ = true;
    x->setZero();
    return solve(b, tolerance, most_iterations, x);
  }
  return report;
}

}  // namespace calipso::fem
