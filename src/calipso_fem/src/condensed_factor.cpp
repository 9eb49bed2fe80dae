#include "calipso_fem/condensed_factor.hpp"

#include <cholmod.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <variant>

#include "calipso_fem/blas_threads.hpp"
#include "supernodal_factor.hpp"

namespace calipso::fem {
namespace {

// The factor's numbers, and what is asked of them.
template <typename Scalar>
struct Numbers {
  using Vector = typename SupernodalFactor<Scalar>::Vector;

  SupernodalFactor<Scalar> factor;
  typename SupernodalFactor<Scalar>::Matrix last;  // L_cc
  Vector reduced;                                  // L^-1 P b

  bool update(const SupernodalPattern& pattern, const std::vector<int>& places,
              const std::vector<double>& entries, int chosen);
  Vec reduce(const SupernodalPattern& pattern, const std::vector<int>& permutation, const Vec& b);
  Vec complete(const SupernodalPattern& pattern, const std::vector<int>& permutation,
               const Vec& forces) const;
};

template <typename Scalar>
bool Numbers<Scalar>::update(const SupernodalPattern& pattern, const std::vector<int>& places,
                             const std::vector<double>& entries, int chosen) {
  std::vector<Scalar> values(pattern.first_value.back(), Scalar(0));
  for (std::size_t k = 0; k < places.size(); ++k)
    if (places[k] >= 0) values[places[k]] = static_cast<Scalar>(entries[k]);
  if (!factor.factorize(pattern, std::move(values))) return false;
  last = factor.lastOfLower(pattern, chosen);
  return true;
}

template <typename Scalar>
Vec Numbers<Scalar>::reduce(const SupernodalPattern& pattern, const std::vector<int>& permutation,
                            const Vec& b) {
  reduced.resize(b.size());
  for (Eigen::Index k = 0; k < b.size(); ++k) reduced[k] = static_cast<Scalar>(b[permutation[k]]);
  factor.solveLower(pattern, reduced);
  Vector end = reduced.tail(last.rows());
  last.template triangularView<Eigen::Lower>().transpose().solveInPlace(end);
  return end.template cast<double>();
}

template <typename Scalar>
Vec Numbers<Scalar>::complete(const SupernodalPattern& pattern, const std::vector<int>& permutation,
                              const Vec& forces) const {
  Vector z = reduced, pushed = forces.cast<Scalar>();
  last.template triangularView<Eigen::Lower>().solveInPlace(pushed);
  z.tail(last.rows()) += pushed;
  factor.solveLowerTransposed(pattern, z);
  Vec result(z.size());
  for (Eigen::Index k = 0; k < z.size(); ++k) result[permutation[k]] = z[k];
  return result;
}

}  // namespace

struct CondensedFactor::Impl {
  cholmod_common common{};
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<int> order;         // of elimination, without chosen nodes: for any choice
  std::vector<int> nodes, index;  // index: by node
  SupernodalPattern blocks;
  std::vector<int> permutation;  // components in the order of elimination
  std::vector<int> places;       // by entry of A: where in L it belongs; -1: above the diagonal
  std::variant<Numbers<float>, Numbers<double>> numbers;
  bool analyzed = false;
  Eigen::MatrixXd compliance;  // empty: not yet asked for

  Impl() {
    useOneBlasThread();
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.nmethods = 1;
    common.postorder = 0;  // would move the chosen nodes
    common.method[0].ordering = CHOLMOD_GIVEN;
  }
  ~Impl() { cholmod_finish(&common); }

  void orderNodes();
  void analyze();
  void placeEntries();
  template <typename Scalar>
  bool factorize(const BlockMatrix& A);
};

// Nested dissection of the graph of nodes.
void CondensedFactor::Impl::orderNodes() {
  const int n = pattern->rows();
  cholmod_sparse* graph =
      cholmod_allocate_sparse(n, n, pattern->blockCount(), 1, 1, 1, CHOLMOD_PATTERN, &common);
  if (!graph)
    throw std::runtime_error("CHOLMOD: no room for the graph of " + std::to_string(n) + " nodes");
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
  const auto components = cholmod_nested_dissection(graph, nullptr, 0, order.data(), parent.data(),
                                                    member.data(), &common);
  cholmod_free_sparse(&graph, &common);
  if (components < 0) throw std::runtime_error("CHOLMOD: ordering failed (out of memory?)");
}

// CHOLMOD finds out which columns of L are alike; the numbers are not its.
void CondensedFactor::Impl::analyze() {
  const int n = pattern->rows();
  const std::size_t entries = 9 * (static_cast<std::size_t>(pattern->blockCount()) - n) / 2 + 6 * n;
  cholmod_sparse* matrix =
      cholmod_allocate_sparse(3 * n, 3 * n, entries, 1, 1, -1, CHOLMOD_PATTERN, &common);
  if (!matrix)
    throw std::runtime_error("CHOLMOD: no room for the pattern of " + std::to_string(n) + " nodes");
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
  permutation.clear();
  const auto append = [&](int node) {
    for (int c = 0; c < 3; ++c) permutation.push_back(3 * node + c);
  };
  for (const int node : order)
    if (index[node] < 0) append(node);
  for (const int node : nodes) append(node);
  cholmod_factor* factor = cholmod_analyze_p(matrix, permutation.data(), nullptr, 0, &common);
  cholmod_free_sparse(&matrix, &common);
  if (!factor) throw std::runtime_error("CHOLMOD: symbolic analysis failed (out of memory?)");
  const auto copied = [](const void* from, std::size_t count) {
    return std::vector<int>(static_cast<const int*>(from), static_cast<const int*>(from) + count);
  };
  blocks.size = 3 * n;
  blocks.first_column = copied(factor->super, factor->nsuper + 1);
  blocks.first_row = copied(factor->pi, factor->nsuper + 1);
  blocks.first_value = copied(factor->px, factor->nsuper + 1);
  blocks.rows = copied(factor->s, factor->ssize);
  cholmod_free_factor(&factor, &common);
  blocks.relate();
  placeEntries();
}

void CondensedFactor::Impl::placeEntries() {
  std::vector<int> rank(permutation.size());
  for (std::size_t k = 0; k < permutation.size(); ++k) rank[permutation[k]] = static_cast<int>(k);
  places.assign(9 * static_cast<std::size_t>(pattern->blockCount()), -1);
  for (int i = 0; i < pattern->rows(); ++i)
    for (int k = pattern->row_start[i]; k < pattern->row_start[i + 1]; ++k)
      for (int c = 0; c < 3; ++c)
        for (int d = 0; d < 3; ++d) {
          const int row = rank[3 * i + c], column = rank[3 * pattern->column[k] + d];
          if (row >= column)
            places[9 * static_cast<std::size_t>(k) + 3 * c + d] = blocks.valueAt(row, column);
        }
}

CondensedFactor::CondensedFactor() : impl_(std::make_unique<Impl>()) {}
CondensedFactor::~CondensedFactor() = default;

template <typename Scalar>
bool CondensedFactor::Impl::factorize(const BlockMatrix& A) {
  if (!std::holds_alternative<Numbers<Scalar>>(numbers)) numbers = Numbers<Scalar>();
  return std::get<Numbers<Scalar>>(numbers).update(blocks, places, A.values,
                                                   3 * static_cast<int>(nodes.size()));
}

bool CondensedFactor::update(const BlockMatrix& A, const std::vector<int>& nodes,
                             double tolerance) {
  Impl& m = *impl_;
  if (A.pattern != m.pattern || nodes != m.nodes || !m.analyzed) {
    m.analyzed = false;
    m.nodes = nodes;
    m.index.assign(A.pattern->rows(), -1);
    for (std::size_t k = 0; k < nodes.size(); ++k) m.index[nodes[k]] = static_cast<int>(k);
    if (A.pattern != m.pattern) {
      m.pattern = A.pattern;
      m.orderNodes();
    }
    m.analyze();
    m.analyzed = true;
  }
  m.compliance.resize(0, 0);
  if (tolerance > 0.0) {
    const bool definite = m.factorize<float>(A);
    const double cancellation = std::get<Numbers<float>>(m.numbers).factor.cancellation();
    if (cancellation * std::numeric_limits<float>::epsilon() <= tolerance) return definite;
  }
  return m.factorize<double>(A);
}

const std::vector<int>& CondensedFactor::nodes() const { return impl_->nodes; }

int CondensedFactor::indexOf(int node) const {
  return impl_->index.empty() ? -1 : impl_->index[node];
}

const Eigen::MatrixXd& CondensedFactor::compliance() {
  Impl& m = *impl_;
  if (m.compliance.size() == 0)
    std::visit(
        [&](const auto& numbers) {
          m.compliance = numbers.factor.inverseFromLower(numbers.last).template cast<double>();
        },
        m.numbers);
  return m.compliance;
}

Vec CondensedFactor::reduce(const Vec& b) {
  return std::visit(
      [&](auto& numbers) { return numbers.reduce(impl_->blocks, impl_->permutation, b); },
      impl_->numbers);
}

Vec CondensedFactor::complete(const Vec& forces) {
  return std::visit(
      [&](auto& numbers) { return numbers.complete(impl_->blocks, impl_->permutation, forces); },
      impl_->numbers);
}

}  // namespace calipso::fem
