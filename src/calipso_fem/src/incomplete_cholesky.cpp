#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "preconditioner.hpp"

namespace calipso::fem {
namespace {

using Block = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// L L^T with the block pattern of A's lower half. Where a pivot fails, the whole is done again with
// a larger diagonal (Manteuffel 1980).
class IncompleteCholesky : public Preconditioner {
 public:
  bool update(const BlockMatrix& A) override {
    pattern_ = A.pattern;
    double shift = 0.0;
    for (int attempt = 0; attempt < 12; ++attempt, shift = std::max(1e-3, 2.0 * shift))
      if (factorize(A, shift)) return true;
    return false;
  }

  void apply(const Vec& r, Vec& z) override {
    const int n = pattern_->rows();
    z = r;
    for (int i = 0; i < n; ++i) {
      Eigen::Vector3d s = z.segment<3>(3 * i);
      for (int k = pattern_->row_start[i]; k < pattern_->diagonal[i]; ++k)
        s.noalias() -= block(k) * z.segment<3>(3 * pattern_->column[k]);
      z.segment<3>(3 * i).noalias() = inverse(i) * s;
    }
    for (int i = n - 1; i >= 0; --i) {
      const Eigen::Vector3d s = inverse(i).transpose() * z.segment<3>(3 * i);
      z.segment<3>(3 * i) = s;
      for (int k = pattern_->row_start[i]; k < pattern_->diagonal[i]; ++k)
        z.segment<3>(3 * pattern_->column[k]).noalias() -= block(k).transpose() * s;
    }
  }

 private:
  Eigen::Map<Block> block(int k) {
    return Eigen::Map<Block>(values_.data() + 9 * static_cast<std::size_t>(k));
  }
  Eigen::Map<Block> inverse(int i) {
    return Eigen::Map<Block>(inverse_.data() + 9 * static_cast<std::size_t>(i));
  }

  // values_: L's blocks left of the diagonal; inverse_: inverses of its diagonal blocks.
  bool factorize(const BlockMatrix& A, double shift) {
    values_ = A.values;
    const int n = pattern_->rows();
    inverse_.resize(9 * static_cast<std::size_t>(n));
    for (int i = 0; i < n; ++i) {
      Block D = A.block(pattern_->diagonal[i]);
      D.diagonal() *= 1.0 + shift;
      for (int k = pattern_->row_start[i]; k < pattern_->diagonal[i]; ++k) {
        const int j = pattern_->column[k];
        block(k) = ((block(k) - commonProduct(i, k, j)) * inverse(j).transpose()).eval();
        D.noalias() -= block(k) * block(k).transpose();
      }
      const Eigen::LLT<Eigen::Matrix3d> llt(D);
      if (llt.info() != Eigen::Success) return false;
      inverse(i) = Eigen::Matrix3d(llt.matrixL()).inverse();
    }
    return true;
  }

  // sum over m < j of L_im L_jm^T
  Block commonProduct(int i, int end, int j) {
    Block sum = Block::Zero();
    int a = pattern_->row_start[i], b = pattern_->row_start[j];
    while (a < end && b < pattern_->diagonal[j]) {
      if (pattern_->column[a] == pattern_->column[b])
        sum.noalias() += block(a++) * block(b++).transpose();
      else if (pattern_->column[a] < pattern_->column[b])
        ++a;
      else
        ++b;
    }
    return sum;
  }

  std::shared_ptr<const BlockPattern> pattern_;
  std::vector<double> values_, inverse_;
};

}  // namespace

std::unique_ptr<Preconditioner> makeIncompleteCholesky() {
  return std::make_unique<IncompleteCholesky>();
}

}  // namespace calipso::fem
