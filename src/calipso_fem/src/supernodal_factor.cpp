#include "supernodal_factor.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

// BLAS and LAPACK, in single and double precision.
extern "C" {
#define CALIPSO_DECLARE(T, p)                                                                     \
  void p##potrf_(const char*, const int*, T*, const int*, int*);                                  \
  void p##potri_(const char*, const int*, T*, const int*, int*);                                  \
  void p##trsm_(const char*, const char*, const char*, const char*, const int*, const int*,       \
                const T*, const T*, const int*, T*, const int*);                                  \
  void p##syrk_(const char*, const char*, const int*, const int*, const T*, const T*, const int*, \
                const T*, T*, const int*);                                                        \
  void p##trsv_(const char*, const char*, const char*, const int*, const T*, const int*, T*,      \
                const int*);                                                                      \
  void p##gemv_(const char*, const int*, const int*, const T*, const T*, const int*, const T*,    \
                const int*, const T*, T*, const int*);
CALIPSO_DECLARE(float, s)
CALIPSO_DECLARE(double, d)
#undef CALIPSO_DECLARE
}

namespace calipso::fem {
namespace {

const int kOne = 1;

#define CALIPSO_OVERLOAD(T, p)                                                                     \
  int choleskyInPlace(int n, T* a, int stride) {                                                   \
    int info = 0;                                                                                  \
    p##potrf_("L", &n, a, &stride, &info);                                                         \
    return info;                                                                                   \
  }                                                                                                \
  int invertInPlace(int n, T* a) {                                                                 \
    int info = 0;                                                                                  \
    p##potri_("L", &n, a, &n, &info);                                                              \
    return info;                                                                                   \
  }                                                                                                \
  /* b <- b L^-T */                                                                                \
  void divideByTransposed(int rows, int columns, const T* L, T* b, int stride) {                   \
    const T one = 1;                                                                               \
    p##trsm_("R", "L", "T", "N", &rows, &columns, &one, L, &stride, b, &stride);                   \
  }                                                                                                \
  /* c = a a^T, lower triangle */                                                                  \
  void square(int rows, int columns, const T* a, int stride, T* c) {                               \
    const T one = 1, zero = 0;                                                                     \
    p##syrk_("L", "N", &rows, &columns, &one, a, &stride, &zero, c, &rows);                        \
  }                                                                                                \
  void solveTriangle(const char* transposed, int n, const T* L, int stride, T* x) {                \
    p##trsv_("L", transposed, "N", &n, L, &stride, x, &kOne);                                      \
  }                                                                                                \
  /* y = factor_x a x + factor_y y, or with a^T */                                                 \
  void multiply(const char* transposed, int rows, int columns, T factor_x, const T* a, int stride, \
                const T* x, T factor_y, T* y) {                                                    \
    p##gemv_(transposed, &rows, &columns, &factor_x, a, &stride, x, &kOne, &factor_y, y, &kOne);   \
  }
CALIPSO_OVERLOAD(float, s)
CALIPSO_OVERLOAD(double, d)
#undef CALIPSO_OVERLOAD

}  // namespace

int SupernodalPattern::valueAt(int row, int column) const {
  const int b = block_of_[column];
  const auto begin = rows.begin() + first_row[b], end = rows.begin() + first_row[b + 1];
  const auto at = std::lower_bound(begin, end, row) - begin;
  return first_value[b] + (column - first_column[b]) * rowsOf(b) + static_cast<int>(at);
}

void SupernodalPattern::relate() {
  block_of_.resize(size);
  for (int b = 0; b < blocks(); ++b)
    std::fill(block_of_.begin() + first_column[b], block_of_.begin() + first_column[b + 1], b);
  first_update.assign(1, 0);
  updates.clear();
  places.clear();
  std::vector<int> place_of(size);
  for (int b = 0; b < blocks(); ++b) {
    const int* own = rows.data() + first_row[b];
    for (int begin = columnsOf(b), end = begin; begin < rowsOf(b); begin = end) {
      const int to = block_of_[own[begin]];
      while (end < rowsOf(b) && own[end] < first_column[to + 1]) ++end;
      for (int k = 0; k < rowsOf(to); ++k) place_of[rows[first_row[to] + k]] = k;
      updates.push_back({to, begin, end, static_cast<int>(places.size())});
      for (int k = begin; k < rowsOf(b); ++k) places.push_back(place_of[own[k]]);
    }
    first_update.push_back(static_cast<int>(updates.size()));
  }
}

template <typename Scalar>
bool SupernodalFactor<Scalar>::factorize(const SupernodalPattern& p, std::vector<Scalar> values) {
  values_ = std::move(values);
  cancellation_ = 1.0;
  std::vector<Scalar> diagonal;
  for (int b = 0; b < p.blocks(); ++b)
    for (int j = 0; j < p.columnsOf(b); ++j)
      diagonal.push_back(values_[p.first_value[b] + j * (p.rowsOf(b) + 1)]);
  for (int b = 0; b < p.blocks(); ++b) {
    const int rows = p.rowsOf(b), columns = p.columnsOf(b), below = rows - columns;
    Scalar* L = values_.data() + p.first_value[b];
    const int failed = choleskyInPlace(columns, L, rows);
    for (int j = 0; j < (failed ? failed : columns); ++j) {
      const double entry = L[j * (rows + 1)],
                   pivot = j + 1 == failed ? std::abs(entry) : entry * entry;
      cancellation_ = std::max(cancellation_, std::abs(diagonal[p.first_column[b] + j]) / pivot);
    }
    if (failed) return false;
    if (below == 0) continue;
    divideByTransposed(below, columns, L, L + columns, rows);
    update_.resize(static_cast<std::size_t>(below) * below);
    square(below, columns, L + columns, rows, update_.data());
    for (int u = p.first_update[b]; u < p.first_update[b + 1]; ++u) {
      const SupernodalPattern::Update& to = p.updates[u];
      const int stride = p.rowsOf(to.block);
      const int* place = p.places.data() + to.first_place - to.begin;
      for (int j = to.begin; j < to.end; ++j) {
        Scalar* target = values_.data() + p.first_value[to.block] + place[j] * stride;
        const Scalar* column =
            update_.data() + static_cast<std::size_t>(j - columns) * below - columns;
        for (int i = j; i < rows; ++i) target[place[i]] -= column[i];
      }
    }
  }
  return true;
}

template <typename Scalar>
void SupernodalFactor<Scalar>::solveLower(const SupernodalPattern& p, Vector& x) const {
  for (int b = 0; b < p.blocks(); ++b) {
    const int rows = p.rowsOf(b), columns = p.columnsOf(b), below = rows - columns;
    const Scalar* L = values_.data() + p.first_value[b];
    Scalar* own = x.data() + p.first_column[b];
    solveTriangle("N", columns, L, rows, own);
    if (below == 0) continue;
    below_.resize(below);
    multiply("N", below, columns, 1, L + columns, rows, own, 0, below_.data());
    const int* row = p.rows.data() + p.first_row[b] + columns;
    for (int i = 0; i < below; ++i) x[row[i]] -= below_[i];
  }
}

template <typename Scalar>
void SupernodalFactor<Scalar>::solveLowerTransposed(const SupernodalPattern& p, Vector& x) const {
  for (int b = p.blocks() - 1; b >= 0; --b) {
    const int rows = p.rowsOf(b), columns = p.columnsOf(b), below = rows - columns;
    const Scalar* L = values_.data() + p.first_value[b];
    Scalar* own = x.data() + p.first_column[b];
    if (below > 0) {
      below_.resize(below);
      const int* row = p.rows.data() + p.first_row[b] + columns;
      for (int i = 0; i < below; ++i) below_[i] = x[row[i]];
      multiply("T", below, columns, -1, L + columns, rows, below_.data(), 1, own);
    }
    solveTriangle("T", columns, L, rows, own);
  }
}

template <typename Scalar>
typename SupernodalFactor<Scalar>::Matrix SupernodalFactor<Scalar>::lastOfLower(
    const SupernodalPattern& p, int n) const {
  Matrix last = Matrix::Zero(n, n);
  const int before = p.size - n;
  for (int b = 0; b < p.blocks(); ++b)
    for (int j = std::max(p.first_column[b], before); j < p.first_column[b + 1]; ++j) {
      const int own = j - p.first_column[b];
      const Scalar* column = values_.data() + p.first_value[b] + own * p.rowsOf(b);
      for (int k = own; k < p.rowsOf(b); ++k)
        last(p.rows[p.first_row[b] + k] - before, j - before) = column[k];
    }
  return last;
}

template <typename Scalar>
typename SupernodalFactor<Scalar>::Matrix SupernodalFactor<Scalar>::inverseFromLower(
    const Matrix& L) {
  Matrix inverse = L;
  if (L.rows() == 0) return inverse;  // LAPACK wants a row at least
  const int info = invertInPlace(static_cast<int>(L.rows()), inverse.data());
  if (info != 0) throw std::runtime_error("LAPACK: potri failed (" + std::to_string(info) + ")");
  inverse.template triangularView<Eigen::StrictlyUpper>() = inverse.transpose();
  return inverse;
}

template class SupernodalFactor<float>;
template class SupernodalFactor<double>;

}  // namespace calipso::fem
