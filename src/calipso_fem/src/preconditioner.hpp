#pragma once

#include <memory>
#include <string>

#include "calipso_fem/block_matrix.hpp"

namespace calipso::fem {

// z ~ A^-1 r for a symmetric positive definite A.
class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  // Takes over the values of A; the pattern is that of construction. False: A is not positive
  // definite as far as this preconditioner can tell.
  virtual bool update(const BlockMatrix& A) = 0;
  // After it has shown not to be positive definite: makes it more so. False: nothing can be done.
  virtual bool widen() { return false; }
  virtual void apply(const Vec& r, Vec& z) = 0;
  // True when apply() solves A z = r to round-off for the matrix of the last update().
  virtual bool isExact() const { return false; }
};

std::unique_ptr<Preconditioner> makeJacobi();
std::unique_ptr<Preconditioner> makeIncompleteCholesky();
std::unique_ptr<Preconditioner> makeCholesky();

}  // namespace calipso::fem
