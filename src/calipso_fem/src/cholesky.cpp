#include <cholmod.h>

#include <stdexcept>

#include "calipso_fem/blas_threads.hpp"
#include "preconditioner.hpp"

namespace calipso::fem {
namespace {

// CHOLMOD's lower triangle of a block matrix; the symbolic analysis is kept while the pattern
// stays.
class Cholesky : public Preconditioner {
 public:
  Cholesky() {
    useOneBlasThread();
    cholmod_start(&common_);
    common_.print = 0;
    common_.supernodal = CHOLMOD_AUTO;
    common_.final_ll = 1;
    common_.quick_return_if_not_posdef = 1;
    // NOTE: METIS orders 3D grids far better than AMD, and is deterministic for a fixed pattern.
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_METIS;
    common_.postorder = 1;
  }

  ~Cholesky() override {
    release();
    cholmod_finish(&common_);
  }

  bool update(const BlockMatrix& A) override {
    if (A.pattern != pattern_) analyze(A);
    fill(A);
    cholmod_factorize(matrix_, factor_, &common_);
    return common_.status == CHOLMOD_OK && factor_->minor == factor_->n;
  }

  void apply(const Vec& r, Vec& z) override {
    cholmod_dense b{};
    b.nrow = b.d = b.nzmax = r.size();
    b.ncol = 1;
    b.x = const_cast<double*>(r.data());
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    cholmod_solve2(CHOLMOD_A, factor_, &b, nullptr, &solution_, nullptr, &y_, &e_, &common_);
    if (!solution_) throw std::runtime_error("CHOLMOD: solve failed (out of memory?)");
    z = Eigen::Map<const Vec>(static_cast<double*>(solution_->x), r.size());
  }

  bool isExact() const override { return true; }

 private:
  void release() {
    cholmod_free_sparse(&matrix_, &common_);
    cholmod_free_factor(&factor_, &common_);
    cholmod_free_dense(&solution_, &common_);
    cholmod_free_dense(&y_, &common_);
    cholmod_free_dense(&e_, &common_);
  }

  // Lower triangle, column by column; row i of the symmetric A read to the right is column i.
  void analyze(const BlockMatrix& A) {
    release();
    pattern_ = A.pattern;
    const int n = pattern_->rows();
    const std::size_t entries =
        9 * (static_cast<std::size_t>(pattern_->blockCount()) - n) / 2 + 6 * n;
    matrix_ = cholmod_allocate_sparse(3 * n, 3 * n, entries, 1, 1, -1, CHOLMOD_REAL, &common_);
    auto* outer = static_cast<int*>(matrix_->p);
    auto* inner = static_cast<int*>(matrix_->i);
    int next = 0;
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < 3; ++c) {
        outer[3 * i + c] = next;
        for (int k = pattern_->diagonal[i]; k < pattern_->row_start[i + 1]; ++k)
          for (int d = k == pattern_->diagonal[i] ? c : 0; d < 3; ++d)
            inner[next++] = 3 * pattern_->column[k] + d;
      }
    outer[3 * n] = next;
    fill(A);
    factor_ = cholmod_analyze(matrix_, &common_);
    if (!factor_) throw std::runtime_error("CHOLMOD: symbolic analysis failed (out of memory?)");
  }

  void fill(const BlockMatrix& A) {
    auto* value = static_cast<double*>(matrix_->x);
    for (int i = 0; i < pattern_->rows(); ++i)
      for (int c = 0; c < 3; ++c)
        for (int k = pattern_->diagonal[i]; k < pattern_->row_start[i + 1]; ++k)
          for (int d = k == pattern_->diagonal[i] ? c : 0; d < 3; ++d)
            *value++ = A.values[9 * static_cast<std::size_t>(k) + 3 * c + d];
  }

  cholmod_common common_{};
  cholmod_sparse* matrix_ = nullptr;
  cholmod_factor* factor_ = nullptr;
  cholmod_dense *solution_ = nullptr, *y_ = nullptr, *e_ = nullptr;
  std::shared_ptr<const BlockPattern> pattern_;
};

}  // namespace

std::unique_ptr<Preconditioner> makeCholesky() { return std::make_unique<Cholesky>(); }

}  // namespace calipso::fem
