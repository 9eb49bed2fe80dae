#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "calipso_fem/block_matrix.hpp"
#include "calipso_fem/elastic_model.hpp"

// Cholesky factor of a symmetric positive definite A whose chosen nodes c come last, so that all
// other nodes i are condensed onto them:
//   A = L L^T,  L_cc L_cc^T = A_cc - A_ci A_ii^-1 A_ic,  (A^-1)_cc = (L_cc L_cc^T)^-1.
namespace calipso::fem {

class CondensedFactor {
 public:
  CondensedFactor();
  ~CondensedFactor();

  // nodes: ascending. The analysis is kept while pattern and nodes stay. False: A is not positive
  // definite. Single precision is taken where it leaves the pivots a relative error below
  // `tolerance`.
  // @throw std::runtime_error when out of memory
  bool update(const BlockMatrix& A, const std::vector<int>& nodes, double tolerance = 0.0);
  const std::vector<int>& nodes() const;
  int indexOf(int node) const;  // among nodes(); -1: not there

  // (A^-1)_cc, 3m x 3m
  const Eigen::MatrixXd& compliance();
  // (A^-1 b)_c, 3m; b (3n) is kept for complete().
  Vec reduce(const Vec& b);
  // A^-1 (b + forces at the chosen nodes), forces: 3m, b as of the last reduce().
  Vec complete(const Vec& forces);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calipso::fem
