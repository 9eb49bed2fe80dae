#include "hex_solver.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <tuple>

namespace calipso::fem {
namespace {

// Renewing the multigrid costs about this many CG iterations.
constexpr double kRenewalCost = 3.0;
constexpr int kGrain = Multigrid::kGrain;
constexpr int kFloatLanes = kHexLanes<float>;

double total(const std::vector<double>& parts) {
  double sum = 0.0;
  for (double part : parts) sum += part;
  return sum;
}

}  // namespace

// Work space of CG, four numbers per node; partial sums per kGrain nodes.
struct HexSolver::Vectors {
  AlignedBuffer<double> x, b, r, p, Ap, slots, viscous_slots;
  std::vector<double> rr, rz, pAp;
  SpringForces<double> springs;

  void allocate(const StvkHexes& h) {
    const std::size_t nodes = h.nodeCount(), blocks = (nodes + kGrain - 1) / kGrain;
    for (auto* field : {&x, &b, &r, &p, &Ap}) field->assign(4 * nodes, 0.0);
    springs.allocate(nodes);
    for (auto* field : {&slots, &viscous_slots}) field->resize(h.slotNumbers<double>());
    for (auto* sums : {&rr, &rz, &pAp}) sums->assign(blocks, 0.0);
  }
};

bool HexSolver::fits(const VolumeMesh& mesh) {
  if (mesh.isTetrahedral() || mesh.lattice.rows() != mesh.nodes.rows()) return false;
  for (int cell = 0; cell < mesh.cellCount(); ++cell)
    for (int c = 1; c < 8; ++c)
      if (mesh.lattice.row(mesh.cells(cell, c)) !=
          mesh.lattice.row(mesh.cells(cell, 0)) + Eigen::RowVector3i(c & 1, (c >> 1) & 1, c >> 2))
        return false;
  return true;
}

namespace {

const LatticeMatrix& checkedLattice(const VolumeMesh& mesh, const StvkHexes& hexes) {
  if (!HexSolver::fits(mesh))
    throw std::invalid_argument("multigrid: the mesh has no lattice; use incomplete_cholesky");
  return hexes.lattice();
}

}  // namespace

HexSolver::HexSolver(const VolumeMesh& mesh, const StvkHexes& hexes)
    : hexes_(nullptr),
      fine_(std::make_unique<HexLevel>()),
      vectors_(std::make_unique<Vectors>()),
      multigrid_(checkedLattice(mesh, hexes)) {
  setHexes(hexes);
}

HexSolver::~HexSolver() = default;

void HexSolver::setHexes(const StvkHexes& hexes) {
  hexes_ = &hexes;
  stale_ = true;
  fine_->allocate(hexes);
  vectors_->allocate(hexes);
  mass_.resize(hexes.nodeCount());
  if (!multigrid_.hasCoarse()) throw std::logic_error("multigrid: the mesh has no coarser level");
  coarsening_ = coarseCells(hexes, multigrid_.transfer());
  if (!multigrid_.coarseMatrix()->pattern)
    multigrid_.setCoarsePattern(
        makeBlockPattern(coarsening_.coarse_cells, multigrid_.transfer().coarseCount()));
  placeBlocks(*multigrid_.coarseMatrix()->pattern, multigrid_.transfer(), &coarsening_);
}

bool HexSolver::setSystem(HexEvaluation* at, HexSystem system, const Eigen::VectorXd& lumped_mass,
                          const std::vector<int>& fixed) {
  x_.swap(at->x);
  stress_.swap(at->stress);
  system_ = std::move(system);
  for (SpringBlock& s : system_.springs)
    for (auto& [node, weight] : s.weights) node = hexes_->nodeOf(node);
  for (int i = 0; i < hexes_->nodeCount(); ++i)
    mass_[i] = system_.inertia * lumped_mass[hexes_->meshNode(i)];
  viscous_x_.resize(system_.viscous_at.size() > 0 ? x_.size() : 0);
  if (!viscous_x_.empty())
    hexes_->take(system_.viscous_at, 0, hexes_->nodeCount(), viscous_x_.data());
  fine_->load(x_, stress_, system_, mass_, fixed);
  vectors_->springs.set(system_.springs);
  current_ = false;
  return !stale_ && wasted_iterations_ < kRenewalCost ? true : refresh();
}

bool HexSolver::refresh() {
  diagonal_.assign(9 * static_cast<std::size_t>(hexes_->nodeCount()), 0.0);
  multigrid_.coarseMatrix()->setZero();
  sumCoarse();
  addMassAndSprings();
  stale_ = !multigrid_.update(fine_.get(), diagonal_);
  current_ = !stale_;
  fresh_rate_ = wasted_iterations_ = 0.0;
  return current_;
}

// Element stiffness of some batches at a time by all threads; then every thread sums up what
// belongs to its rows, in the order of the cells.
void HexSolver::sumCoarse() {
  constexpr int kBatches = 16;
  std::vector<HexStiffness, AlignedAllocator<HexStiffness>> some(kBatches);
  BlockMatrix& Ac = *multigrid_.coarseMatrix();
  const int batches = hexes_->batchCount<float>(), nodes = hexes_->nodeCount();
  const auto stiffness = [&](int batch, HexStiffness* s) {
    for (int axis = 0; axis < 3; ++axis)
      for (int l = 0; l < kFloatLanes; ++l)
        s->even[axis][l] = coarsening_.parity[kFloatLanes * batch + l] >> axis & 1 ? 0.0f : 1.0f;
    hexKernel().stiffness(hexes_->batches<float>(), batch, fine_->x.data(), fine_->stress.data(),
                          fine_->factor, fine_->free.data(), s);
  };
  const auto addCell = [&](int place, const HexStiffness& s, std::pair<int, int> rows,
                           std::pair<int, int> coarse_rows) {
    const int cell = hexes_->order()[place], coarse = coarsening_.coarse_of[place];
    if (cell < 0) return;
    const int l = place % kFloatLanes;
    for (int a = 0; a < 8; ++a) {
      const int node = hexes_->cells()(cell, a);
      if (node >= rows.first && node < rows.second)
        for (int k = 0; k < 9; ++k) diagonal_[9L * node + k] += s.diagonal[a][k][l];
      const int row = coarsening_.coarse_cells(coarse, a);
      if (row < coarse_rows.first || row >= coarse_rows.second) continue;
      for (int b = 0; b < 8; ++b) {
        double* block = Ac.values.data() + 9L * coarsening_.block_of[64 * coarse + 8 * a + b];
        for (int k = 0; k < 9; ++k) block[k] += s.K[3 * a + k / 3][3 * b + k % 3][l];
      }
    }
  };
  runParallel([&](const Crew& crew) {
    const auto rows = crew.share(nodes), coarse_rows = crew.share(Ac.pattern->rows());
    for (int first = 0; first < batches; first += kBatches) {
      const int count = std::min(kBatches, batches - first);
      const auto [begin, end] = crew.share(count);
      for (int k = begin; k < end; ++k) stiffness(first + k, &some[k]);
      crew.barrier();
      for (int k = 0; k < count; ++k)
        for (int l = 0; l < kFloatLanes; ++l)
          addCell(kFloatLanes * (first + k) + l, some[k], rows, coarse_rows);
      crew.barrier();
    }
  });
}

void HexSolver::addMassAndSprings() {
  BlockMatrix& Ac = *multigrid_.coarseMatrix();
  const GridTransfer& t = multigrid_.transfer();
  const float* free = fine_->free.data();
  const int* parents = coarsening_.parent_blocks.data();
  for (int i = 0; i < hexes_->nodeCount(); ++i) {
    const double m = mass_[i];
    for (int c = 0; c < 3; ++c) diagonal_[9L * i + 4 * c] += m * free[4L * i + c];
    for (int p = t.parent_start[i]; p < t.parent_start[i + 1]; ++p)
      for (int q = t.parent_start[i]; q < t.parent_start[i + 1]; ++q) {
        auto block = Ac.block(*parents++);
        for (int c = 0; c < 3; ++c)
          block(c, c) += m * t.parents[p].weight * t.parents[q].weight * free[4L * i + c];
      }
  }
  for (const SpringBlock& s : system_.springs)
    for (const auto& [i, wi] : s.weights)
      for (const auto& [j, wj] : s.weights) {
        const Eigen::Vector3d fi = Eigen::Map<const Eigen::Vector3f>(free + 4L * i).cast<double>(),
                              fj = Eigen::Map<const Eigen::Vector3f>(free + 4L * j).cast<double>();
        const Eigen::Matrix3d block = wi * wj * fi.asDiagonal() * s.block * fj.asDiagonal();
        if (i == j)
          for (int k = 0; k < 9; ++k) diagonal_[9L * i + k] += block(k / 3, k % 3);
        for (int p = t.parent_start[i]; p < t.parent_start[i + 1]; ++p)
          for (int q = t.parent_start[j]; q < t.parent_start[j + 1]; ++q) {
            // What the coarse pattern has no place for only makes the preconditioner a little
            // stiffer.
            const int k = Ac.pattern->tryFind(t.parents[p].node, t.parents[q].node);
            Ac.block(k >= 0 ? k : Ac.pattern->diagonal[t.parents[p].node]) +=
                t.parents[p].weight * t.parents[q].weight * block;
          }
      }
}

// y = A x for nodes begin .. end of this thread; x is complete.
void HexSolver::product(const Crew& crew, int begin, int end, const double* x, double* y) const {
  Vectors& v = *vectors_;
  const bool springs = !v.springs.empty(), apart = !viscous_x_.empty();
  if (crew.rank() == 0 && springs) v.springs.apply(x);
  const auto multiply = [&](int first, int last) {
    hexKernel().multiply(hexes_->batches<double>(), first, last, x_.data(), stress_.data(),
                         apart ? 1.0 : 1.0 + system_.viscosity, x, v.slots.data());
    if (apart)
      hexKernel().multiply(hexes_->batches<double>(), first, last, viscous_x_.data(), nullptr,
                           system_.viscosity, x, v.viscous_slots.data());
  };
  sweepRows<double>(crew, *hexes_, begin, end, !springs, multiply, [&](int node) {
    double* row = y + 4L * node;
    hexes_->sumSlots(v.slots.data(), node, row);
    if (apart) {
      alignas(32) double viscous[4];
      hexes_->sumSlots(v.viscous_slots.data(), node, viscous);
      for (int c = 0; c < 3; ++c) row[c] += viscous[c];
    }
    for (int c = 0; c < 3; ++c) row[c] += mass_[node] * x[4L * node + c];
    if (!springs) return;
    for (int c = 0; c < 3; ++c) row[c] += v.springs.at(node)[c];
  });
}

void HexSolver::multiply(const Vec& x, Vec* y) {
  Vectors& v = *vectors_;
  y->resize(x.size());
  runParallel([&](const Crew& crew) {
    const auto [begin, end] = crew.share(hexes_->nodeCount(), kGrain);
    hexes_->take(x, begin, end, v.p.data());
    crew.barrier();
    product(crew, begin, end, v.p.data(), v.Ap.data());
    hexes_->give(v.Ap.data(), begin, end, y);
  });
}

double HexSolver::roundOff(const Vec& y) const {
  constexpr double kUnit = 2e-16;
  std::vector<double> sums(vectors_->rr.size());
  parallelFor(static_cast<int>(sums.size()), 16, [&](int first, int last) {
    for (int block = first; block < last; ++block) {
      double sum = 0.0;
      for (int i = kGrain * block; i < std::min(kGrain * (block + 1), hexes_->nodeCount()); ++i)
        for (int c = 0; c < 3; ++c) {
          const double force = diagonal_[9L * i + 4 * c] * y[3L * hexes_->meshNode(i) + c];
          sum += force * force;
        }
      sums[block] = sum;
    }
  });
  return kUnit * std::sqrt(total(sums));
}

SolveReport HexSolver::solve(const Vec& b, double tolerance, int most_iterations, Vec* x) {
  SolveReport report = iterate(b, tolerance, most_iterations, x);
  if (decades_ > 0.0) {
    if (fresh_rate_ == 0.0) fresh_rate_ = report.iterations / decades_;
    wasted_iterations_ += std::max(0.0, report.iterations - fresh_rate_ * decades_);
  }
  // A worn preconditioner can make CG stall; a fresh one gets a second chance.
  if (!report.converged && !current_ && refresh()) {
    x->setZero();
    return solve(b, tolerance, most_iterations, x);
  }
  if (!report.preconditioner_positive && system_.positive && multigrid_.widen()) {
    stale_ = true;  // the next system gets its own smoothers
    x->setZero();
    return solve(b, tolerance, most_iterations, x);
  }
  return report;
}

// One thread's part in preconditioned conjugate gradients on nodes begin .. end. Sums run over
// blocks of kGrain nodes, then over the blocks, whatever the number of threads.
class HexSolver::Iteration {
 public:
  Iteration(HexSolver* solver, const Crew& crew)
      : s_(*solver), v_(*solver->vectors_), crew_(crew), free_(solver->fine_->free.data()) {
    std::tie(begin_, end_) = crew.share(s_.hexes_->nodeCount(), kGrain);
  }

  // r = b - A x; x = 0 where that is no worse. Returns |r|.
  double start(const Vec& b, const Vec& x, double scale) {
    s_.hexes_->take(b, begin_, end_, v_.b.data());
    s_.hexes_->take(x, begin_, end_, v_.x.data());
    const bool from_zero = x.isZero(0.0);
    crew_.barrier();
    if (!from_zero) s_.product(crew_, begin_, end_, v_.x.data(), v_.Ap.data());
    double residual = firstResidual(from_zero);
    if (from_zero || !(residual > scale)) return residual;
    crew_.barrier();  // every thread has read the sums
    std::fill(v_.x.begin() + 4L * begin_, v_.x.begin() + 4L * end_, 0.0);
    return firstResidual(true);
  }

  // z ~ A^-1 r; p = z + (r z / previous r z) p. The residual's size is taken out for the cycle, so
  // that single precision has room.
  bool turn(double residual, bool first) {
    float* right_side = s_.multigrid_.rightSide();
    const double inverse = 1.0 / residual;
    for (long k = 4L * begin_; k < 4L * end_; ++k)
      right_side[k] = static_cast<float>(v_.r[k] * inverse);
    crew_.barrier();
    s_.multigrid_.cycle(crew_);
    crew_.barrier();
    const float* z = s_.multigrid_.result();
    const double next = residual * sum(&v_.rz, [&](long k) { return v_.r[k] * z[k]; });
    const double beta = first ? 0.0 : next / rz_;
    rz_ = next;
    for (long k = 4L * begin_; k < 4L * end_; ++k) v_.p[k] = residual * z[k] + beta * v_.p[k];
    return rz_ > 0.0;
  }

  // x += t p, r -= t A p with the t that minimises. Returns |r|; nothing where A is not positive
  // along p.
  std::optional<double> advance() {
    crew_.barrier();  // p is complete
    s_.product(crew_, begin_, end_, v_.p.data(), v_.Ap.data());
    const double curvature = sum(&v_.pAp, [&](long k) {
      v_.Ap[k] *= free_[k];
      return v_.p[k] * v_.Ap[k];
    });
    if (!(curvature > 0.0)) return std::nullopt;
    const double step = rz_ / curvature;
    return std::sqrt(sum(&v_.rr, [&](long k) {
      v_.x[k] += step * v_.p[k];
      v_.r[k] -= step * v_.Ap[k];
      return v_.r[k] * v_.r[k];
    }));
  }

  void finish(Vec* solution) const { s_.hexes_->give(v_.x.data(), begin_, end_, solution); }

 private:
  double firstResidual(bool from_zero) {
    return std::sqrt(sum(&v_.rr, [&](long k) {
      v_.r[k] = free_[k] * (from_zero ? v_.b[k] : v_.b[k] - v_.Ap[k]);
      return v_.r[k] * v_.r[k];
    }));
  }

  // Sum of work(k) over the components k = 4 node + c of all threads' nodes.
  template <class Work>
  double sum(std::vector<double>* sums, const Work& work) {
    for (int block = begin_; block < end_; block += kGrain) {
      double sum = 0.0;
      for (long k = 4L * block; k < 4L * std::min(block + kGrain, end_); ++k) sum += work(k);
      (*sums)[block / kGrain] = sum;
    }
    crew_.barrier();
    return total(*sums);
  }

  HexSolver& s_;
  Vectors& v_;
  const Crew& crew_;
  const float* free_;
  int begin_ = 0, end_ = 0;
  double rz_ = 0.0;
};

SolveReport HexSolver::iterate(const Vec& b, double tolerance, int most_iterations, Vec* solution) {
  SolveReport report;
  const double scale = b.norm();
  runParallel([&](const Crew& crew) {
    Iteration cg(this, crew);
    const double first = cg.start(b, *solution, scale);
    double residual = first;
    int iteration = 0;
    bool positive = true, turned = true;
    for (; positive && iteration < most_iterations && !(residual <= tolerance * scale);
         ++iteration) {
      turned = cg.turn(residual, iteration == 0);
      const std::optional<double> next = turned ? cg.advance() : std::nullopt;
      residual = next.value_or(residual);
      positive = next.has_value() && residual < kRunaway * std::max(first, scale);
    }
    cg.finish(solution);
    if (crew.rank() != 0) return;
    report.iterations = iteration;
    decades_ = iteration > 0 && residual > 0.0 ? std::log10(first / residual) : 0.0;
    report.positive = positive;
    report.preconditioner_positive = turned;
    report.residual = scale > 0.0 ? residual / scale : residual;
    report.converged = positive && residual <= tolerance * scale;
  });
  return report;
}

}  // namespace calipso::fem
