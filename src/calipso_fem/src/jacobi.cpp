#include <Eigen/LU>

#include "preconditioner.hpp"
#include "thread_team.hpp"

namespace calipso::fem {
namespace {

using Block = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

class Jacobi : public Preconditioner {
 public:
  bool update(const BlockMatrix& A) override {
    const int n = A.pattern->rows();
    inverse_.resize(9 * n);
    bool positive = true;
    for (int i = 0; i < n; ++i) {
      const Block D = A.block(A.pattern->diagonal[i]);
      positive = positive && D.determinant() > 0.0 && D.trace() > 0.0;
      Eigen::Map<Block>(inverse_.data() + 9 * i) = D.inverse();
    }
    return positive;
  }

  void apply(const Vec& r, Vec& z) override {
    const int n = static_cast<int>(r.size()) / 3;
    z.resize(r.size());
    parallelFor(n, 500, [&](int begin, int end) {
      for (int i = begin; i < end; ++i)
        z.segment<3>(3 * i).noalias() =
            Eigen::Map<const Block>(inverse_.data() + 9 * i) * r.segment<3>(3 * i);
    });
  }

 private:
  std::vector<double> inverse_;
};

}  // namespace

std::unique_ptr<Preconditioner> makeJacobi() { return std::make_unique<Jacobi>(); }

}  // namespace calipso::fem
