#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::fem {

// Where the numbers of L in A = L L^T go: columns of alike rows are stored as one dense block,
// column by column.
struct SupernodalPattern {
  int size = 0;
  std::vector<int> first_column;  // #blocks + 1
  std::vector<int> first_row;     // #blocks + 1, into rows
  std::vector<int> rows;          // of each block, ascending; its own columns come first
  std::vector<int> first_value;   // #blocks + 1
  // What a block's rows below its columns are to each of the blocks that these are columns of:
  // ranges of its rows [begin, end), and where its rows from `begin` on are among that block's.
  struct Update {
    int block = 0, begin = 0, end = 0, first_place = 0;
  };
  std::vector<int> first_update;  // #blocks + 1
  std::vector<Update> updates;
  std::vector<int> places;

  int blocks() const { return static_cast<int>(first_column.size()) - 1; }
  int columnsOf(int block) const { return first_column[block + 1] - first_column[block]; }
  int rowsOf(int block) const { return first_row[block + 1] - first_row[block]; }
  // Of entry (row, column) of L. @pre it is in the pattern
  int valueAt(int row, int column) const;
  // Fills `updates` and `places` from the rest.
  void relate();

 private:
  std::vector<int> block_of_;  // by column
};

// Cholesky factor with such a pattern, in single or double precision. Each block is factorised once
// those before it have been subtracted from it, and is subtracted from those after it.
template <typename Scalar>
class SupernodalFactor {
 public:
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;

  // values: A's lower triangle where pattern.valueAt() says, else zero; becomes L. False: not
  // positive definite.
  bool factorize(const SupernodalPattern& pattern, std::vector<Scalar> values);
  // A_ii over what elimination leaves of it, the largest: so many times the rounding error are the
  // pivots off. Of the pivot that is not positive, too.
  double cancellation() const { return cancellation_; }

  void solveLower(const SupernodalPattern& pattern, Vector& x) const;            // L x = b
  void solveLowerTransposed(const SupernodalPattern& pattern, Vector& x) const;  // L^T x = b
  // Of the last n rows and columns.
  Matrix lastOfLower(const SupernodalPattern& pattern, int n) const;
  static Matrix inverseFromLower(const Matrix& L);  // (L L^T)^-1

 private:
  std::vector<Scalar> values_, update_;
  mutable Vector below_;
  double cancellation_ = 1.0;
};

}  // namespace calipso::fem
