#pragma once

#include <memory>
#include <vector>

#include "aligned_buffer.hpp"
#include "grid_transfer.hpp"
#include "hex_level.hpp"
#include "preconditioner.hpp"

namespace calipso::fem {

// A block matrix in single precision, four numbers per column of a block.
struct FloatMatrix {
  std::shared_ptr<const BlockPattern> pattern;
  AlignedBuffer<float> values;  // 12 per block

  void assign(const BlockMatrix& A);
  Quad row(int i, const float* x) const;
};

// Multigrid cycles on the voxel hierarchy in single precision: Chebyshev over block Jacobi,
// Galerkin coarse levels, the coarsest by a dense inverse. Nodal fields hold four numbers per node.
class Multigrid {
 public:
  explicit Multigrid(const LatticeMatrix& lattice);

  // Level 1 and its pattern; what the caller sums the coarse operator into. Null: there is no
  // level 1.
  void setCoarsePattern(std::shared_ptr<const BlockPattern> pattern);
  BlockMatrix* coarseMatrix();
  const GridTransfer& transfer() const { return levels_.front().to_coarse; }
  bool hasCoarse() const { return levels_.size() > 1; }

  // Builds all levels below the finest from coarseMatrix(), and smoothers. diagonal: 9 per fine
  // node, zero rows and columns for fixed components. False: not positive definite.
  bool update(HexLevel* fine, const AlignedBuffer<double>& diagonal);
  // The same for an assembled finest level.
  bool update(const BlockMatrix& A);

  // Smooths for larger eigenvalues than were estimated, up to their bound. False: it has been
  // reached. For cycles that have shown not to be positive definite.
  bool widen();

  float* rightSide() { return levels_.front().b.data(); }
  const float* result() const { return levels_.front().z.data(); }
  // result ~ A^-1 rightSide. Called by every thread of a region, with a barrier before.
  void cycle(const Crew& crew) { cycle(crew, 0); }

  static constexpr int kGrain = 64;  // nodes that stay on one thread

 private:
  struct Level {
    int nodes = 0;
    BlockMatrix own;  // not of the finest
    FloatMatrix A;    // unused where `fine` is set
    HexLevel* fine = nullptr;
    GridTransfer to_coarse;        // unused on the coarsest level
    float lambda_max = 1.0f;       // of D^-1 A
    AlignedBuffer<float> inverse;  // of the diagonal blocks, as FloatMatrix's
    AlignedBuffer<float> b, z, r, d, e, eigen;
    std::vector<double> norms;
  };

  void allocate(Level* level) const;
  bool invertDiagonal(const double* blocks, Level* level) const;
  bool updateCoarse();
  bool factorizeCoarsest();
  void estimate(Level* level) const;
  void solveCoarsest(Level* level) const;
  void cycle(const Crew& crew, std::size_t l);
  void pass(const Crew& crew, std::size_t l, const float* residual, bool z_is_zero);
  void smoothFirst(const Crew& crew, Level& level, const float* r, bool z_is_zero) const;
  void smoothSecond(const Crew& crew, Level& level, bool need_residual) const;
  template <class Work>
  void product(const Crew& crew, Level& level, const float* x, const Work& work) const;

  std::vector<Level> levels_;
  AlignedBuffer<float> coarsest_inverse_;
};

// As a preconditioner of an assembled matrix. @throw std::invalid_argument for a mesh without
// lattice
std::unique_ptr<Preconditioner> makeMultigrid(const VolumeMesh& mesh);

}  // namespace calipso::fem
