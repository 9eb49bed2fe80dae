#include "sheet_step.hpp"

namespace calipso::flow {
namespace {

constexpr int kFactors = 4;     // of a step, at most
constexpr int kIterations = 6;  // with each of them
constexpr int kViscosity = 3;   // steps for which it is kept

}  // namespace

SheetStep::SheetStep(fem::DeformableBody& body) : body_(body), mass_(3 * body.nodeCount()) {
  std::vector<int> index(mass_.size(), -1);
  for (int d = 0; d < mass_.size(); ++d) {
    mass_[d] = body.model().lumpedMass()[d / 3];
    if (body.isFixed(d / 3)) continue;
    index[d] = static_cast<int>(free_.size());
    free_.push_back(d);
  }
  // Every entry is given its number as value, to find the place that it gets.
  const fem::BlockPattern& pattern = *body.model().pattern();
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<int> entry_of(9 * pattern.blockCount(), -1);
  for (int i = 0; i < pattern.rows(); ++i) {
    for (int b = pattern.row_start[i]; b < pattern.row_start[i + 1]; ++b) {
      for (int e = 0; e < 9; ++e) {
        const int row = index[3 * i + e / 3], column = index[3 * pattern.column[b] + e % 3];
        if (column < 0 || row < column) continue;
        entry_of[9 * b + e] = static_cast<int>(entries.size());
        entries.emplace_back(row, column, static_cast<double>(entries.size()));
      }
    }
  }
  A_.resize(free_.size(), free_.size());
  A_.setFromTriplets(entries.begin(), entries.end());
  std::vector<int> place(entries.size());
  for (Eigen::Index p = 0; p < A_.nonZeros(); ++p)
    place[static_cast<size_t>(A_.valuePtr()[p])] = static_cast<int>(p);
  for (const int entry : entry_of) slots_.push_back(entry < 0 ? -1 : place[entry]);
  factor_.analyzePattern(A_);
}

void SheetStep::advance(double h, double tolerance) {
  if (age_ == 0) {
    body_.model().viscosity(body_.positions(), D_);
    for (double& value : D_.values) value *= body_.model().cellMaterials().front().damping;
  }
  age_ = (age_ + 1) % kViscosity;
  body_.beginStep(h);
  body_.predictTrial();
  for (int k = 0; k < kFactors; ++k) {
    if (!factorise(h, fem::Definiteness::kExact) && !factorise(h, fem::Definiteness::kPositive))
      return;
    if (iterate(tolerance)) return;
  }
}

bool SheetStep::iterate(double tolerance) {
  const fem::Vec none = fem::Vec::Zero(mass_.size());
  for (int k = 0; k < kIterations; ++k) {
    if (body_.trialResidual(none) <= tolerance) return true;
    const fem::Vec x = body_.trialPositions(), step = solve(body_.trialDescent());
    const double length = body_.trialStepLength(x + step, none);
    if (length == 0.0) return false;
    body_.moveTrial(x + length * step);
  }
  return body_.trialResidual(none) <= tolerance;
}

bool SheetStep::factorise(double h, fem::Definiteness definiteness) {
  body_.model().hessian(body_.trialPositions(), definiteness, K_);
  for (size_t e = 0; e < slots_.size(); ++e) {
    if (slots_[e] >= 0) A_.valuePtr()[slots_[e]] = K_.values[e] + D_.values[e] / h;
  }
  for (size_t f = 0; f < free_.size(); ++f) A_.coeffRef(f, f) += mass_[free_[f]] / (h * h);
  factor_.factorize(A_);
  return factor_.info() == Eigen::Success && factor_.vectorD().minCoeff() > 0.0;
}

Eigen::MatrixXd SheetStep::solve(const Eigen::Ref<const Eigen::MatrixXd>& B) const {
  Eigen::MatrixXd b(free_.size(), B.cols());
  for (size_t f = 0; f < free_.size(); ++f) b.row(f) = B.row(free_[f]);
  const Eigen::MatrixXd x = factor_.solve(b);
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(B.rows(), B.cols());
  for (size_t f = 0; f < free_.size(); ++f) all.row(free_[f]) = x.row(f);
  return all;
}

}  // namespace calipso::flow
