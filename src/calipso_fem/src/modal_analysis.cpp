#include "calipso_fem/modal_analysis.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <stdexcept>

#include "body_impl.hpp"

namespace calipso::fem {
namespace {

constexpr int kMostIterations = 200;
constexpr double kTolerance = 1e-11;  // relative change of omega^2
constexpr double kTwoPi = 6.28318530717958647692;

Eigen::MatrixXd startBlock(int rows, int columns) {
  Eigen::MatrixXd X(rows, columns);
  for (int c = 0; c < columns; ++c)
    for (int r = 0; r < rows; ++r) X(r, c) = std::sin(1.3 + 0.37 * r * (c + 1) + 1.1 * c);
  return X;
}

Eigen::MatrixXd applyMass(const ElasticModel& model, const BlockMatrix& consistent, bool lumped,
                          const Eigen::MatrixXd& X) {
  Eigen::MatrixXd MX(X.rows(), X.cols());
  Vec y;
  for (int c = 0; c < X.cols(); ++c) {
    if (!lumped) {
      consistent.multiply(X.col(c), y);
      MX.col(c) = y;
      continue;
    }
    for (int r = 0; r < X.rows(); ++r) MX(r, c) = model.lumpedMass()[r / 3] * X(r, c);
  }
  return MX;
}

}  // namespace

ModalResult naturalFrequencies(const ElasticModel& model, const std::vector<int>& fixed_dofs,
                               int count, bool lumped) {
  std::map<int, PrescribedDof> fixed;
  for (int dof : fixed_dofs) {
    if (dof < 0 || dof >= model.dofCount())
      throw std::invalid_argument("modal analysis: dof " + std::to_string(dof) + " does not exist");
    fixed[dof] = {};
  }
  const int free = model.dofCount() - static_cast<int>(fixed.size());
  if (count < 1 || count > free)
    throw std::invalid_argument("modal analysis: " + std::to_string(count) +
                                " modes asked for, allowed is 1.." + std::to_string(free));
  BlockMatrix K;
  model.hessian(restPositions(model.mesh()), Definiteness::kExact, K);
  eliminate(fixed, &K);
  const auto cholesky = makeCholesky();
  if (!cholesky->update(K))
    throw std::runtime_error("modal analysis: the stiffness is singular; fix more nodes");
  const BlockMatrix M = lumped ? BlockMatrix() : model.consistentMass();

  const int block = std::min(free, 2 * count + 8);
  Eigen::MatrixXd X = startBlock(model.dofCount(), block);
  ModalResult result;
  Eigen::VectorXd before = Eigen::VectorXd::Zero(count);
  for (; result.iterations < kMostIterations && !result.converged; ++result.iterations) {
    Eigen::MatrixXd MX = applyMass(model, M, lumped, X);
    for (const auto& [dof, unused] : fixed) MX.row(dof).setZero();
    Vec column;
    for (int c = 0; c < block; ++c) {
      cholesky->apply(MX.col(c), column);
      X.col(c) = column;
    }
    // Rayleigh-Ritz in the span of K^-1 M X: K X = MX there.
    const Eigen::MatrixXd Kr = X.transpose() * MX;
    const Eigen::MatrixXd Mr = X.transpose() * applyMass(model, M, lumped, X);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(
        0.5 * (Kr + Kr.transpose()), 0.5 * (Mr + Mr.transpose()));
    X = (X * ritz.eigenvectors()).eval();
    const Eigen::VectorXd now = ritz.eigenvalues().head(count);
    result.converged = ((now - before).cwiseAbs().array() <= kTolerance * now.array()).all();
    before = now;
  }
  result.frequencies = before.cwiseMax(0.0).cwiseSqrt() / kTwoPi;
  result.modes = X.leftCols(count);
  return result;
}

}  // namespace calipso::fem
