#include "calipso_fem/condensed_factor.hpp"

#include <cholmod.h>
#include <omp.h>

#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <string>

// LAPACK: inverse of A from its Cholesky factor, lower triangle.
extern "C" void dpotri_(const char* uplo, const int* n, double* a, const int* lda, int* info);

namespace calipso::fem {
namespace {

// CHOLMOD asks OpenMP for more threads than there are processors; its small supernodes lose by any. The level
// is the process's: the first to come changes it, the last to go changes it back.
class OneThread {
 public:
  OneThread() {
    const std::lock_guard<std::mutex> lock(mutex);
    if (users++ > 0) return;
    levels = omp_get_max_active_levels();
    omp_set_max_active_levels(0);
  }
  ~OneThread() {
    const std::lock_guard<std::mutex> lock(mutex);
    if (--users == 0) omp_set_max_active_levels(levels);
  }

 private:
  static inline std::mutex mutex;
  static inline int users = 0, levels = 1;
};

}  // namespace

struct CondensedFactor::Impl {
  cholmod_common common{};
  cholmod_sparse* matrix = nullptr;
  cholmod_factor* factor = nullptr;
  cholmod_dense *solution = nullptr, *y = nullptr, *e = nullptr;
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<int> order;                // of elimination, without chosen nodes: for any choice
  std::vector<int> nodes, index;         // index: by node
  Eigen::MatrixXd last;                  // L_cc
  Eigen::MatrixXd compliance;            // empty: not yet asked for
  Vec reduced;                           // L^-1 P b

  Impl() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.final_ll = 1;
    common.quick_return_if_not_posdef = 1;
    common.nmethods = 1;
    common.postorder = 0;  // would move the chosen nodes
  }
  ~Impl() {
    release();
    cholmod_finish(&common);
  }

  void release() {
    cholmod_free_sparse(&matrix, &common);
    cholmod_free_factor(&factor, &common);
    cholmod_free_dense(&solution, &common);
    cholmod_free_dense(&y, &common);
    cholmod_free_dense(&e, &common);
  }

  void orderNodes();
  void analyze(const BlockMatrix& A);
  void fill(const BlockMatrix& A);
  void readLast();
  Eigen::Map<const Vec> solve(int system, const Vec& b);
};

// Nested dissection of the graph of nodes.
void CondensedFactor::Impl::orderNodes() {
  const int n = pattern->rows();
  cholmod_sparse* graph =
      cholmod_allocate_sparse(n, n, pattern->blockCount(), 1, 1, 1, CHOLMOD_PATTERN, &common);
  auto* outer = static_cast<int*>(graph->p);
  auto* inner = static_cast<int*>(graph->i);
  int next = 0;
  for (int i = 0; i < n; ++i) {
    outer[i] = next;
    for (int k = pattern->row_start[i]; k <= pattern->diagonal[i]; ++k)
      inner[next++] = pattern->column[k];
  }
  outer[n] = next;
  order.resize(n);
  std::vector<int> parent(n), member(n);
  const auto components =
      cholmod_nested_dissection(graph, nullptr, 0, order.data(), parent.data(), member.data(), &common);
  cholmod_free_sparse(&graph, &common);
  if (components < 0) throw std::runtime_error("CHOLMOD: ordering failed (out of memory?)");
}

void CondensedFactor::Impl::analyze(const BlockMatrix& A) {
  release();
  if (A.pattern != pattern) {
    pattern = A.pattern;
    orderNodes();
  }
  const int n = pattern->rows();
  const std::size_t entries = 9 * (static_cast<std::size_t>(pattern->blockCount()) - n) / 2 + 6 * n;
  matrix = cholmod_allocate_sparse(3 * n, 3 * n, entries, 1, 1, -1, CHOLMOD_REAL, &common);
  auto* outer = static_cast<int*>(matrix->p);
  auto* inner = static_cast<int*>(matrix->i);
  int next = 0;
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) {
      outer[3 * i + c] = next;
      for (int k = pattern->diagonal[i]; k < pattern->row_start[i + 1]; ++k)
        for (int d = k == pattern->diagonal[i] ? c : 0; d < 3; ++d)
          inner[next++] = 3 * pattern->column[k] + d;
    }
  outer[3 * n] = next;
  std::vector<int> permutation;
  const auto append = [&](int node) {
    for (int c = 0; c < 3; ++c) permutation.push_back(3 * node + c);
  };
  for (const int node : order)
    if (index[node] < 0) append(node);
  for (const int node : nodes) append(node);
  fill(A);
  common.method[0].ordering = CHOLMOD_GIVEN;
  factor = cholmod_analyze_p(matrix, permutation.data(), nullptr, 0, &common);
  if (!factor) throw std::runtime_error("CHOLMOD: symbolic analysis failed (out of memory?)");
}

// Lower triangle, column by column; row i of the symmetric A read to the right is column i.
void CondensedFactor::Impl::fill(const BlockMatrix& A) {
  auto* value = static_cast<double*>(matrix->x);
  for (int i = 0; i < pattern->rows(); ++i)
    for (int c = 0; c < 3; ++c)
      for (int k = pattern->diagonal[i]; k < pattern->row_start[i + 1]; ++k)
        for (int d = k == pattern->diagonal[i] ? c : 0; d < 3; ++d)
          *value++ = A.values[9 * static_cast<std::size_t>(k) + 3 * c + d];
}

void CondensedFactor::Impl::readLast() {
  const int n = static_cast<int>(factor->n), m = 3 * static_cast<int>(nodes.size());
  const auto *super = static_cast<int*>(factor->super), *pi = static_cast<int*>(factor->pi),
             *px = static_cast<int*>(factor->px), *s = static_cast<int*>(factor->s);
  const auto* x = static_cast<double*>(factor->x);
  last.setZero(m, m);
  for (std::size_t k = 0; k < factor->nsuper; ++k) {
    const int rows = pi[k + 1] - pi[k];
    for (int j = std::max(super[k], n - m); j < super[k + 1]; ++j)
      for (int r = j - super[k]; r < rows; ++r)
        last(s[pi[k] + r] - (n - m), j - (n - m)) = x[px[k] + (j - super[k]) * rows + r];
  }
}

Eigen::Map<const Vec> CondensedFactor::Impl::solve(int system, const Vec& b) {
  cholmod_dense right{};
  right.nrow = right.d = right.nzmax = b.size();
  right.ncol = 1;
  right.x = const_cast<double*>(b.data());
  right.xtype = CHOLMOD_REAL;
  right.dtype = CHOLMOD_DOUBLE;
  cholmod_solve2(system, factor, &right, nullptr, &solution, nullptr, &y, &e, &common);
  if (!solution) throw std::runtime_error("CHOLMOD: solve failed (out of memory?)");
  return {static_cast<const double*>(solution->x), b.size()};
}

CondensedFactor::CondensedFactor() : impl_(std::make_unique<Impl>()) {}
CondensedFactor::~CondensedFactor() = default;

bool CondensedFactor::update(const BlockMatrix& A, const std::vector<int>& nodes) {
  Impl& m = *impl_;
  if (A.pattern != m.pattern || nodes != m.nodes || !m.factor) {
    m.nodes = nodes;
    m.index.assign(A.pattern->rows(), -1);
    for (std::size_t k = 0; k < nodes.size(); ++k) m.index[nodes[k]] = static_cast<int>(k);
    m.analyze(A);
  }
  m.fill(A);
  m.compliance.resize(0, 0);
  const OneThread serial;
  cholmod_factorize(m.matrix, m.factor, &m.common);
  if (m.common.status != CHOLMOD_OK || m.factor->minor != m.factor->n) return false;
  m.readLast();
  return true;
}

const std::vector<int>& CondensedFactor::nodes() const { return impl_->nodes; }

int CondensedFactor::indexOf(int node) const {
  return impl_->index.empty() ? -1 : impl_->index[node];
}

const Eigen::MatrixXd& CondensedFactor::compliance() {
  Impl& m = *impl_;
  if (m.compliance.size() > 0 || m.last.size() == 0) return m.compliance;
  m.compliance = m.last;
  const int n = static_cast<int>(m.last.rows());
  int info = 0;
  dpotri_("L", &n, m.compliance.data(), &n, &info);
  if (info != 0) throw std::runtime_error("LAPACK: dpotri failed (" + std::to_string(info) + ")");
  m.compliance.triangularView<Eigen::StrictlyUpper>() = m.compliance.transpose();
  return m.compliance;
}

Vec CondensedFactor::reduce(const Vec& b) {
  Impl& m = *impl_;
  const auto* permutation = static_cast<const int*>(m.factor->Perm);
  Vec permuted(b.size());
  for (Eigen::Index k = 0; k < b.size(); ++k) permuted[k] = b[permutation[k]];
  m.reduced = m.solve(CHOLMOD_L, permuted);
  Vec end = m.reduced.tail(m.last.rows());
  m.last.triangularView<Eigen::Lower>().transpose().solveInPlace(end);
  return end;
}

Vec CondensedFactor::complete(const Vec& forces) {
  Impl& m = *impl_;
  Vec z = m.reduced;
  z.tail(m.last.rows()) += m.last.triangularView<Eigen::Lower>().solve(forces);
  const auto x = m.solve(CHOLMOD_Lt, z);
  const auto* permutation = static_cast<const int*>(m.factor->Perm);
  Vec result(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) result[permutation[k]] = x[k];
  return result;
}

}  // namespace calipso::fem
