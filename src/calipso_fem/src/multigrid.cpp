#include "multigrid.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace calipso::fem {
namespace {

constexpr int kCoarsestNodes = 60;
constexpr int kSerialNodes = 200;       // below: not worth a barrier
constexpr float kSmootherRange = 8.0f;  // Chebyshev on [lambda_max / range, lambda_max]
constexpr int kPowerIterations = 8;

// Chebyshev polynomial of degree 2 (Saad, Iterative methods, algorithm 12.1):
// d1 = r / theta; d2 = previous d1 + correction D^-1 r.
struct Chebyshev {
  float inverse_theta, previous, correction;
  explicit Chebyshev(float upper) {
    const float lower = upper / kSmootherRange;
    const float theta = 0.5f * (upper + lower), delta = 0.5f * (upper - lower);
    const float rho = delta / theta, next = 1.0f / (2.0f * theta / delta - rho);
    inverse_theta = 1.0f / theta;
    previous = next * rho;
    correction = 2.0f * next / delta;
  }
};

// Components whose row holds nothing but the diagonal are marked by zero.
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

// A coarse component that no free fine one feeds has an empty row and, as its inverse diagonal is
// zero, never moves. The coarsest inverse needs a unit row there.
void fillEmptyRows(BlockMatrix* A) {
  for (int k : A->pattern->diagonal)
    for (int c = 0; c < 3; ++c)
      if (A->block(k)(c, c) == 0.0) A->block(k)(c, c) = 1.0;
}

AlignedBuffer<double> diagonalBlocks(const BlockMatrix& A, const Vec& free) {
  AlignedBuffer<double> blocks(9 * static_cast<std::size_t>(A.pattern->rows()));
  for (int i = 0; i < A.pattern->rows(); ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        blocks[9 * i + 3 * r + c] =
            A.block(A.pattern->diagonal[i])(r, c) * free[3 * i + r] * free[3 * i + c];
  return blocks;
}

}  // namespace

void FloatMatrix::assign(const BlockMatrix& from) {
  pattern = from.pattern;
  values.resize(12 * static_cast<std::size_t>(pattern->blockCount()));
  parallelFor(pattern->blockCount(), 4096, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      const double* a = from.values.data() + 9 * static_cast<std::size_t>(k);
      float* v = values.data() + 12 * static_cast<std::size_t>(k);
      for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) v[4 * c + r] = static_cast<float>(a[3 * r + c]);
        v[4 * c + 3] = 0.0f;
      }
    }
  });
}

inline Quad FloatMatrix::row(int i, const float* x) const {
  Quad sum{};
  const float* block = values.data() + 12 * static_cast<std::size_t>(pattern->row_start[i]);
  for (int k = pattern->row_start[i]; k < pattern->row_start[i + 1]; ++k, block += 12)
    sum += multiplyBlock(block, loadQuad(x + 4 * static_cast<std::size_t>(pattern->column[k])));
  return sum;
}

Multigrid::Multigrid(const LatticeMatrix& lattice) {
  levels_.emplace_back();
  levels_.back().nodes = static_cast<int>(lattice.rows());
  LatticeMatrix fine = lattice.rowwise() - lattice.colwise().minCoeff();
  while (levels_.back().nodes > kCoarsestNodes) {
    GridTransfer transfer = makeGridTransfer(fine);
    if (transfer.coarseCount() >= 0.9 * transfer.fineCount()) break;
    fine = transfer.coarse_lattice;
    levels_.back().to_coarse = std::move(transfer);
    levels_.emplace_back();
    levels_.back().nodes = static_cast<int>(fine.rows());
  }
  for (Level& level : levels_) allocate(&level);
}

void Multigrid::allocate(Level* level) const {
  const std::size_t size = 4 * static_cast<std::size_t>(level->nodes);
  for (auto* field : {&level->b, &level->z, &level->r, &level->d, &level->e, &level->eigen})
    field->assign(size, 0.0f);
  level->inverse.resize(3 * size);
  level->norms.resize((level->nodes + kGrain - 1) / kGrain);
}

void Multigrid::setCoarsePattern(std::shared_ptr<const BlockPattern> pattern) {
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    if (l > 1) pattern = coarsePattern(*pattern, levels_[l - 1].to_coarse);
    levels_[l].own = BlockMatrix(pattern);
  }
}

BlockMatrix* Multigrid::coarseMatrix() { return hasCoarse() ? &levels_[1].own : nullptr; }

bool Multigrid::invertDiagonal(const double* blocks, Level* level) const {
  bool positive = true;
  for (int i = 0; i < level->nodes; ++i) {
    Eigen::Matrix3d D = Eigen::Map<const Eigen::Matrix3d>(blocks + 9 * static_cast<std::size_t>(i));
    Eigen::Vector3d free = Eigen::Vector3d::Ones();
    for (int c = 0; c < 3; ++c)
      if (D(c, c) == 0.0) free[c] = 0.0, D(c, c) = 1.0;
    positive = positive && D.determinant() > 0.0 && D.trace() > 0.0;
    const Eigen::Matrix3d inverse = free.asDiagonal() * D.inverse() * free.asDiagonal();
    float* out = level->inverse.data() + 12 * static_cast<std::size_t>(i);
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) out[4 * c + r] = static_cast<float>(inverse(r, c));
      out[4 * c + 3] = 0.0f;
    }
  }
  return positive;
}

bool Multigrid::update(HexLevel* fine, const AlignedBuffer<double>& diagonal) {
  Level& finest = levels_.front();
  finest.fine = fine;
  if (!invertDiagonal(diagonal.data(), &finest)) return false;
  if (!updateCoarse()) return false;
  if (hasCoarse()) estimate(&finest);
  return true;
}

bool Multigrid::update(const BlockMatrix& A) {
  Level& finest = levels_.front();
  finest.A.assign(A);
  const Vec free = freeComponents(A);
  if (!invertDiagonal(diagonalBlocks(A, free).data(), &finest)) return false;
  if (!hasCoarse()) {
    finest.own = A;
    return factorizeCoarsest();
  }
  if (levels_[1].own.pattern == nullptr)
    setCoarsePattern(coarsePattern(*A.pattern, finest.to_coarse));
  galerkin(A, finest.to_coarse, free, &levels_[1].own);
  if (!updateCoarse()) return false;
  estimate(&finest);
  return true;
}

bool Multigrid::updateCoarse() {
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    Level& level = levels_[l];
    const Vec all = Vec::Ones(3 * level.nodes);
    if (!invertDiagonal(diagonalBlocks(level.own, all).data(), &level)) return false;
    if (l + 1 == levels_.size()) break;
    level.A.assign(level.own);
    galerkin(level.own, level.to_coarse, all, &levels_[l + 1].own);
    estimate(&level);
  }
  return hasCoarse() ? factorizeCoarsest() : true;
}

// x^T A x <= 8 x^T D x, because every cell has eight corners.
bool Multigrid::widen() {
  constexpr float kBound = 8.0f, kFactor = 1.5f;
  bool wider = false;
  for (std::size_t l = 0; l + 1 < levels_.size(); ++l) {
    float& lambda = levels_[l].lambda_max;
    wider = wider || lambda < kBound;
    lambda = std::min(kBound, kFactor * lambda);
  }
  return wider;
}

bool Multigrid::factorizeCoarsest() {
  fillEmptyRows(&levels_.back().own);
  Eigen::MatrixXd A(levels_.back().own.toSparse());
  Eigen::LLT<Eigen::MatrixXd> llt(A);
  if (llt.info() != Eigen::Success) {
    // Where most nodes are fixed, coarse ones may move the same few free ones: A is singular.
    constexpr double kShift = 1e-5;
    A.diagonal() *= 1.0 + kShift;
    llt.compute(A);
  }
  if (llt.info() != Eigen::Success) return false;
  const Eigen::MatrixXd inverse = llt.solve(Eigen::MatrixXd::Identity(A.rows(), A.cols()));
  const int n = levels_.back().nodes;
  coarsest_inverse_.assign(12 * static_cast<std::size_t>(n) * n, 0.0f);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r)
          coarsest_inverse_[12 * (static_cast<std::size_t>(i) * n + j) + 4 * c + r] =
              static_cast<float>(inverse(3 * i + r, 3 * j + c));
  return true;
}

void Multigrid::solveCoarsest(Level* level) const {
  const float* block = coarsest_inverse_.data();
  for (int i = 0; i < level->nodes; ++i) {
    Quad sum{};
    for (int j = 0; j < level->nodes; ++j, block += 12)
      sum += multiplyBlock(block, loadQuad(level->b.data() + 4 * j));
    storeQuad(level->z.data() + 4 * i, sum);
  }
}

// Calls work(node, row of A x) for this thread's nodes, in any order. @pre x is complete
template <class Work>
void Multigrid::product(const Crew& crew, Level& level, const float* x, const Work& work) const {
  const auto [begin, end] = crew.share(level.nodes, kGrain);
  if (level.fine) return level.fine->product(crew, x, begin, end, work);
  for (int i = begin; i < end; ++i) work(i, level.A.row(i, x));
}

// Power iteration on D^-1 A; goes on from the vector of the last time.
void Multigrid::estimate(Level* level) const {
  float* x = level->eigen.data();
  bool fresh = true;
  for (float value : level->eigen) fresh = fresh && value == 0.0f;
  const int iterations = fresh ? kPowerIterations : kPowerIterations / 2;
  const int blocks = static_cast<int>(level->norms.size());
  runParallel([&](const Crew& crew) {
    const auto [begin, end] = crew.share(level->nodes, kGrain);
    // A fixed start that is no smooth function of the node number.
    if (fresh)
      for (int k = 4 * begin; k < 4 * end; ++k)
        x[k] = k % 4 < 3 ? std::sin(1.7f + 2.3f * (k % 4099)) : 0.0f;
    float scale = 1.0f, lambda = 1.0f;
    crew.barrier();
    for (int it = 0; it < iterations; ++it) {
      product(crew, *level, x, [&](int i, Quad Ax) {
        const Quad y = splat(scale) *
                       multiplyBlock(level->inverse.data() + 12 * static_cast<std::size_t>(i), Ax);
        storeQuad(level->e.data() + 4 * static_cast<std::size_t>(i), y);
      });
      for (int first = begin; first < end; first += kGrain) {
        double norm = 0.0;
        for (long k = 4L * first; k < 4L * std::min(first + kGrain, end); ++k)
          norm += static_cast<double>(level->e[k] * level->e[k]);
        level->norms[first / kGrain] = norm;
      }
      crew.barrier();
      double sum = 0.0;
      for (int k = 0; k < blocks; ++k) sum += level->norms[k];
      lambda = static_cast<float>(std::sqrt(sum));
      std::copy(level->e.begin() + 4L * begin, level->e.begin() + 4L * end, x + 4L * begin);
      scale = lambda > 0.0f ? 1.0f / lambda : 1.0f;
      crew.barrier();
    }
    for (int k = 4 * begin; k < 4 * end; ++k) x[k] *= scale;
    if (crew.rank() == 0) level->lambda_max = 1.1f * lambda;
  });
}

// level.r = r; z += d, d = D^-1 r / theta; d complete after a barrier.
void Multigrid::smoothFirst(const Crew& crew, Level& level, const float* r, bool z_is_zero) const {
  const Chebyshev c(level.lambda_max);
  const auto [begin, end] = crew.share(level.nodes, kGrain);
  for (long i = begin; i < end; ++i) {
    const Quad r_i = loadQuad(r + 4 * i);
    const Quad d = splat(c.inverse_theta) * multiplyBlock(level.inverse.data() + 12 * i, r_i);
    const Quad z = z_is_zero ? d : loadQuad(level.z.data() + 4 * i) + d;
    storeQuad(level.r.data() + 4 * i, r_i);
    storeQuad(level.d.data() + 4 * i, d);
    storeQuad(level.z.data() + 4 * i, z);
  }
}

// r -= A d; z += e, the second Chebyshev step; then, when needed, r -= A e. @pre d is complete
void Multigrid::smoothSecond(const Crew& crew, Level& level, bool need_residual) const {
  const Chebyshev c(level.lambda_max);
  product(crew, level, level.d.data(), [&](long i, Quad Ad) {
    const Quad r = loadQuad(level.r.data() + 4 * i) - Ad;
    const Quad e = splat(c.previous) * loadQuad(level.d.data() + 4 * i) +
                   splat(c.correction) * multiplyBlock(level.inverse.data() + 12 * i, r);
    storeQuad(level.r.data() + 4 * i, r);
    storeQuad(level.e.data() + 4 * i, e);
    storeQuad(level.z.data() + 4 * i, loadQuad(level.z.data() + 4 * i) + e);
  });
  if (!need_residual) return;
  crew.barrier();
  product(crew, level, level.e.data(), [&](long i, Quad Ae) {
    storeQuad(level.r.data() + 4 * i, loadQuad(level.r.data() + 4 * i) - Ae);
  });
}

// @pre b is complete; afterwards z is, after a barrier.
void Multigrid::cycle(const Crew& crew, std::size_t l) {
  Level& level = levels_[l];
  if (crew.count() > 1 && level.nodes < kSerialNodes) {
    if (crew.rank() == 0) cycle(Crew(0, 1), l);
    return;
  }
  if (l + 1 == levels_.size()) {
    if (crew.rank() == 0) solveCoarsest(&level);
    return;
  }
  pass(crew, l, level.b.data(), true);
  if (l == 0) return;
  // A second one on the coarse levels, where trilinear interpolation is too stiff in bending and
  // one leaves much of the error: a W-cycle.
  crew.barrier();
  product(crew, level, level.z.data(), [&](long i, Quad Az) {
    storeQuad(level.r.data() + 4 * i, loadQuad(level.b.data() + 4 * i) - Az);
  });
  crew.barrier();
  pass(crew, l, level.r.data(), false);
}

// z += smoothing, coarse correction and smoothing of the residual r.
void Multigrid::pass(const Crew& crew, std::size_t l, const float* residual, bool z_is_zero) {
  Level& level = levels_[l];
  const auto [begin, end] = crew.share(level.nodes, kGrain);
  smoothFirst(crew, level, residual, z_is_zero);
  crew.barrier();
  smoothSecond(crew, level, true);
  crew.barrier();
  Level& coarse = levels_[l + 1];
  const GridTransfer& t = level.to_coarse;
  const auto [first, last] = crew.share(coarse.nodes, kGrain);
  for (int I = first; I < last; ++I) {
    Quad sum{};
    for (int k = t.child_start[I]; k < t.child_start[I + 1]; ++k)
      sum += splat(static_cast<float>(t.children[k].weight)) *
             loadQuad(level.r.data() + 4 * static_cast<long>(t.children[k].node));
    storeQuad(coarse.b.data() + 4 * static_cast<long>(I), sum);
  }
  crew.barrier();
  cycle(crew, l + 1);
  crew.barrier();
  // The correction moves no fixed component: their inverse diagonal is zero.
  for (long i = begin; i < end; ++i) {
    Quad sum{};
    for (int k = t.parent_start[i]; k < t.parent_start[i + 1]; ++k)
      sum += splat(static_cast<float>(t.parents[k].weight)) *
             loadQuad(coarse.z.data() + 4 * static_cast<long>(t.parents[k].node));
    const float* D = level.inverse.data() + 12 * i;
    const auto moves = [D](int c) { return D[5 * c] != 0.0f ? 1.0f : 0.0f; };
    sum *= Quad{moves(0), moves(1), moves(2), 0.0f};
    storeQuad(level.d.data() + 4 * i, sum);
    storeQuad(level.z.data() + 4 * i, loadQuad(level.z.data() + 4 * i) + sum);
  }
  crew.barrier();
  product(crew, level, level.d.data(), [&](long i, Quad Ad) {
    storeQuad(level.r.data() + 4 * i, loadQuad(level.r.data() + 4 * i) - Ad);
  });
  crew.barrier();
  smoothFirst(crew, level, level.r.data(), false);
  crew.barrier();
  smoothSecond(crew, level, false);
}

}  // namespace calipso::fem
