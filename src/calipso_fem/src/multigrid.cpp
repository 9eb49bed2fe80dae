#include "multigrid.hpp"

#include <cmath>
#include <stdexcept>

#include "grid_transfer.hpp"

namespace calipso::fem {
namespace {

constexpr int kCoarsestNodes = 60;
constexpr int kSmootherDegree = 2;
constexpr double kSmootherRange = 8.0;    // Chebyshev on [lambda_max / range, lambda_max]
constexpr int kPowerIterations = 8;

struct Level {
  BlockMatrix own;                  // of the coarse levels; the finest uses the caller's matrix
  const BlockMatrix* A = nullptr;
  GridTransfer to_coarse;           // unused on the coarsest level
  std::unique_ptr<Preconditioner> jacobi = makeJacobi();
  double lambda_max = 1.0;          // of D^-1 A
  Vec free;                         // 1, or 0 for an eliminated component
  Vec r, z, d, Az, correction, correction_fine;
};

// Components whose row holds nothing but the diagonal.
Vec freeComponents(const BlockMatrix& A) {
  const BlockPattern& pattern = *A.pattern;
  Vec free = Vec::Zero(3 * pattern.rows());
  for (int i = 0; i < pattern.rows(); ++i)
    for (int k = pattern.row_start[i]; k < pattern.row_start[i + 1]; ++k)
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s)
          if ((k != pattern.diagonal[i] || r != s) &&
              A.values[9 * static_cast<std::size_t>(k) + 3 * r + s] != 0.0)
            free[3 * i + r] = 1.0;
  return free;
}

// A coarse component that no free fine one feeds gets a unit row.
void fillEmptyRows(BlockMatrix* A) {
  for (int k : A->pattern->diagonal)
    for (int c = 0; c < 3; ++c)
      if (A->block(k)(c, c) == 0.0) A->block(k)(c, c) = 1.0;
}

double largestEigenvalue(const BlockMatrix& A, Preconditioner& jacobi) {
  Vec x(3 * A.pattern->rows()), Ax;
  // A fixed start that is no smooth function of the node number.
  for (Eigen::Index k = 0; k < x.size(); ++k) x[k] = std::sin(1.7 + 2.3 * k + 0.9 * (k % 7));
  double lambda = 1.0;
  for (int it = 0; it < kPowerIterations; ++it) {
    A.multiply(x, Ax);
    jacobi.apply(Ax, x);
    lambda = x.norm();
    x /= lambda;
  }
  return 1.1 * lambda;
}

class Multigrid : public Preconditioner {
 public:
  explicit Multigrid(const VolumeMesh& mesh) : lattice_(mesh.lattice) {
    if (lattice_.rows() != mesh.nodes.rows())
      throw std::invalid_argument("multigrid: the mesh has no lattice; use incomplete_cholesky");
  }

  bool update(const BlockMatrix& A) override {
    if (levels_.empty() || levels_[0].own.pattern != A.pattern) buildHierarchy(A.pattern);
    levels_[0].own.values = A.values;
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      Level& level = levels_[l];
      level.A = &level.own;
      if (l + 1 == levels_.size()) return coarse_->update(*level.A);
      if (!level.jacobi->update(*level.A)) return false;
      level.lambda_max = largestEigenvalue(*level.A, *level.jacobi);
      level.free = freeComponents(*level.A);
      galerkin(*level.A, level.to_coarse, level.free, &levels_[l + 1].own);
      fillEmptyRows(&levels_[l + 1].own);
    }
    return true;
  }

  void apply(const Vec& r, Vec& z) override { cycle(0, r, z); }

 private:
  void buildHierarchy(std::shared_ptr<const BlockPattern> pattern) {
    levels_.clear();
    levels_.emplace_back();
    levels_[0].own = BlockMatrix(std::move(pattern));
    LatticeMatrix lattice = lattice_.rowwise() - lattice_.colwise().minCoeff();
    while (levels_.back().own.pattern->rows() > kCoarsestNodes) {
      GridTransfer transfer = makeGridTransfer(lattice);
      if (transfer.coarseCount() >= 0.9 * transfer.fineCount()) break;
      lattice = transfer.coarse_lattice;
      auto coarse = coarsePattern(*levels_.back().own.pattern, transfer);
      levels_.back().to_coarse = std::move(transfer);
      levels_.emplace_back();
      levels_.back().own = BlockMatrix(std::move(coarse));
    }
    coarse_ = makeCholesky();
  }

  // z += Chebyshev polynomial in D^-1 A of the residual r - A z (r: right side; z_is_zero saves a
  // product).
  void smooth(Level& level, const Vec& b, bool z_is_zero, Vec& z) {
    const double upper = level.lambda_max, lower = upper / kSmootherRange;
    const double theta = 0.5 * (upper + lower), delta = 0.5 * (upper - lower);
    double rho = delta / theta;
    if (z_is_zero) {
      level.r = b;
      z.setZero(b.size());
    } else {
      level.A->multiply(z, level.Az);
      level.r = b - level.Az;
    }
    level.jacobi->apply(level.r, level.d);
    level.d /= theta;
    for (int k = 0;; ++k) {
      z += level.d;
      if (k + 1 == kSmootherDegree) return;
      level.A->multiply(level.d, level.Az);
      level.r -= level.Az;
      level.jacobi->apply(level.r, level.z);
      const double rho_next = 1.0 / (2.0 * theta / delta - rho);
      level.d = rho_next * rho * level.d + 2.0 * rho_next / delta * level.z;
      rho = rho_next;
    }
  }

  void cycle(std::size_t l, const Vec& b, Vec& z) {
    Level& level = levels_[l];
    if (l + 1 == levels_.size()) {
      coarse_->apply(b, z);
      return;
    }
    smooth(level, b, true, z);
    level.A->multiply(z, level.Az);
    level.r = (b - level.Az).cwiseProduct(level.free);
    Level& coarse = levels_[l + 1];
    Vec coarse_b;
    level.to_coarse.restrictTo(level.r, &coarse_b);
    cycle(l + 1, coarse_b, coarse.correction);
    level.correction_fine.setZero(z.size());
    level.to_coarse.prolongAdd(coarse.correction, &level.correction_fine);
    z += level.correction_fine.cwiseProduct(level.free);
    smooth(level, b, false, z);
  }

  LatticeMatrix lattice_;
  std::vector<Level> levels_;
  std::unique_ptr<Preconditioner> coarse_;
};

}  // namespace

std::unique_ptr<Preconditioner> makeMultigrid(const VolumeMesh& mesh) {
  return std::make_unique<Multigrid>(mesh);
}

}  // namespace calipso::fem
