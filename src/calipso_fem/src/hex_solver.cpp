#include "hex_solver.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace calipso::fem {
namespace {

// Renewing the multigrid costs about this many CG iterations.
constexpr double kRenewalCost = 3.0;
constexpr int kGrain = Multigrid::kGrain;
constexpr int kFloatLanes = kHexLanes<float>;

}  // namespace

// Work space of CG, four numbers per node; partial sums per kGrain nodes.
struct HexSolver::Vectors {
  AlignedBuffer<double> x, r, p, Ap, slots;
  std::vector<double> rr, rz, pAp;
  SpringForces<double> springs;

  void allocate(const StvkHexes& h) {
    const std::size_t nodes = h.nodeCount(), blocks = (nodes + kGrain - 1) / kGrain;
    for (auto* field : {&x, &r, &p, &Ap}) field->assign(4 * nodes, 0.0);
    springs.allocate(nodes);
    slots.resize(h.slotNumbers<double>());
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

HexCoarsening makeCoarsening(const VolumeMesh& mesh, const StvkHexes& hexes, const GridTransfer& t) {
  const LatticeMatrix& coarse = t.coarse_lattice;
  const Eigen::RowVector3i low = mesh.lattice.colwise().minCoeff();
  const Eigen::RowVector3i size = coarse.colwise().maxCoeff().array() + 1;
  LatticeIndex node(size), cell_id(size);
  for (int i = 0; i < coarse.rows(); ++i) node.at(coarse(i, 0), coarse(i, 1), coarse(i, 2)) = i;
  HexCoarsening c;
  std::vector<Eigen::RowVector3i> corners;
  for (int cell : hexes.order()) {
    if (cell < 0) {
      c.coarse_of.push_back(-1);
      c.parity.push_back(0);
      continue;
    }
    const Eigen::RowVector3i at = mesh.lattice.row(mesh.cells(cell, 0)) - low, parent = at / 2;
    int& id = cell_id.at(parent.x(), parent.y(), parent.z());
    if (id < 0) {
      id = static_cast<int>(corners.size());
      corners.push_back(parent);
    }
    c.coarse_of.push_back(id);
    c.parity.push_back((at.x() & 1) | (at.y() & 1) << 1 | (at.z() & 1) << 2);
  }
  c.coarse_cells.resize(corners.size(), 8);
  for (std::size_t k = 0; k < corners.size(); ++k)
    for (int b = 0; b < 8; ++b)
      c.coarse_cells(k, b) = node.at(corners[k].x() + (b & 1), corners[k].y() + ((b >> 1) & 1),
                                     corners[k].z() + (b >> 2));
  return c;
}

}  // namespace

HexSolver::HexSolver(const VolumeMesh& mesh, const StvkHexes& hexes)
    : mesh_(mesh), hexes_(nullptr), fine_(std::make_unique<HexLevel>()),
      vectors_(std::make_unique<Vectors>()), multigrid_(mesh.lattice) {
  if (!fits(mesh))
    throw std::invalid_argument("multigrid: the mesh has no lattice; use incomplete_cholesky");
  setHexes(hexes);
}

HexSolver::~HexSolver() = default;

void HexSolver::setHexes(const StvkHexes& hexes) {
  hexes_ = &hexes;
  stale_ = true;
  fine_->allocate(hexes);
  vectors_->allocate(hexes);
  if (!multigrid_.hasCoarse()) throw std::logic_error("multigrid: the mesh has no coarser level");
  coarsening_ = makeCoarsening(mesh_, hexes, multigrid_.transfer());
  if (!multigrid_.coarseMatrix()->pattern)
    multigrid_.setCoarsePattern(
        makeBlockPattern(coarsening_.coarse_cells, multigrid_.transfer().coarseCount()));
  const BlockPattern& pattern = *multigrid_.coarseMatrix()->pattern;
  coarsening_.block_of.clear();
  for (int k = 0; k < coarsening_.coarse_cells.rows(); ++k)
    for (int a = 0; a < 8; ++a)
      for (int b = 0; b < 8; ++b)
        coarsening_.block_of.push_back(
            pattern.find(coarsening_.coarse_cells(k, a), coarsening_.coarse_cells(k, b)));
}

bool HexSolver::setSystem(HexEvaluation* at, HexSystem system, const Eigen::VectorXd& lumped_mass,
                          const std::vector<int>& fixed) {
  x_.swap(at->x);
  stress_.swap(at->stress);
  system_ = std::move(system);
  lumped_mass_ = &lumped_mass;
  fine_->load(x_, stress_, system_, lumped_mass, fixed);
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

// Element stiffness of some batches at a time by all threads; then every thread sums up what belongs to its rows,
// in the order of the cells.
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
      const int node = mesh_.cells(cell, a);
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
  for (int i = 0; i < hexes_->nodeCount(); ++i) {
    const double m = system_.inertia * (*lumped_mass_)[i];
    for (int c = 0; c < 3; ++c) diagonal_[9L * i + 4 * c] += m * free[4L * i + c];
    for (int p = t.parent_start[i]; p < t.parent_start[i + 1]; ++p)
      for (int q = t.parent_start[i]; q < t.parent_start[i + 1]; ++q) {
        auto block = Ac.block(Ac.pattern->find(t.parents[p].node, t.parents[q].node));
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
            // What the coarse pattern has no place for only makes the preconditioner a little stiffer.
            const int k = Ac.pattern->tryFind(t.parents[p].node, t.parents[q].node);
            Ac.block(k >= 0 ? k : Ac.pattern->diagonal[t.parents[p].node]) +=
                t.parents[p].weight * t.parents[q].weight * block;
          }
      }
}

// Element part of y = A x; complete after a barrier.
void HexSolver::product(const Crew& crew, const double* x) const {
  const auto [begin, end] = crew.share(hexes_->batchCount<double>());
  hexKernel().multiply(hexes_->batches<double>(), begin, end, x_.data(), stress_.data(),
                       system_.factor, x, vectors_->slots.data());
  if (crew.rank() == 0 && !vectors_->springs.empty()) vectors_->springs.apply(x);
}

void HexSolver::productRow(int node, const double* x, double* y) const {
  hexes_->sumSlots(vectors_->slots.data(), node, y);
  const double m = system_.inertia * (*lumped_mass_)[node];
  for (int c = 0; c < 3; ++c) y[c] += m * x[4L * node + c];
  if (vectors_->springs.empty()) return;
  for (int c = 0; c < 3; ++c) y[c] += vectors_->springs.at(node)[c];
}

void HexSolver::multiply(const Vec& x, Vec* y) {
  Vectors& v = *vectors_;
  const int nodes = hexes_->nodeCount();
  y->resize(x.size());
  runParallel([&](const Crew& crew) {
    const auto [begin, end] = crew.share(nodes, kGrain);
    for (int i = begin; i < end; ++i)
      for (int c = 0; c < 4; ++c) v.p[4L * i + c] = c < 3 ? x[3 * i + c] : 0.0;
    crew.barrier();
    product(crew, v.p.data());
    crew.barrier();
    for (int i = begin; i < end; ++i) {
      alignas(32) double row[4];
      productRow(i, v.p.data(), row);
      for (int c = 0; c < 3; ++c) (*y)[3 * i + c] = row[c];
    }
  });
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
  return report;
}

// Preconditioned conjugate gradients by all threads. Sums run over blocks of kGrain nodes, then over the
// blocks, whatever the number of threads.
SolveReport HexSolver::iterate(const Vec& b, double tolerance, int most_iterations, Vec* solution) {
  SolveReport report;
  const int nodes = hexes_->nodeCount();
  Vectors& v = *vectors_;
  const float* free = fine_->free.data();
  const double scale = b.norm();
  const bool from_zero = solution->isZero(0.0);
  const auto total = [](const std::vector<double>& parts) {
    double sum = 0.0;
    for (double part : parts) sum += part;
    return sum;
  };
  runParallel([&](const Crew& crew) {
    const auto [begin, end] = crew.share(nodes, kGrain);
    // Calls work(4 i, sum) for this thread's nodes i.
    const auto eachNode = [first = begin, last = end](std::vector<double>* sums, const auto& work) {
      for (int block = first; block < last; block += kGrain) {
        double sum = 0.0;
        for (int i = block; i < std::min(block + kGrain, last); ++i) work(4L * i, &sum);
        (*sums)[block / kGrain] = sum;
      }
    };
    for (long i = begin; i < end; ++i)
      for (int c = 0; c < 4; ++c) v.x[4 * i + c] = c < 3 ? (*solution)[3 * i + c] : 0.0;
    crew.barrier();
    if (!from_zero) product(crew, v.x.data());
    crew.barrier();
    eachNode(&v.rr, [&](long i, double* sum) {
      alignas(32) double row[4] = {0.0, 0.0, 0.0, 0.0};
      if (!from_zero) productRow(static_cast<int>(i / 4), v.x.data(), row);
      for (int c = 0; c < 3; ++c) {
        v.r[i + c] = free[i + c] * (b[i / 4 * 3 + c] - row[c]);
        *sum += v.r[i + c] * v.r[i + c];
      }
    });
    crew.barrier();
    double residual = std::sqrt(total(v.rr)), rz = 0.0;
    if (!from_zero && residual > scale) {   // a start worse than none
      crew.barrier();
      eachNode(&v.rr, [&](long i, double* sum) {
        for (int c = 0; c < 3; ++c) {
          v.x[i + c] = 0.0;
          v.r[i + c] = free[i + c] * b[i / 4 * 3 + c];
          *sum += v.r[i + c] * v.r[i + c];
        }
      });
      crew.barrier();
      residual = std::sqrt(total(v.rr));
    }
    const double first_residual = residual;
    int iteration = 0;
    bool positive = true;
    for (; iteration < most_iterations && !(residual <= tolerance * scale); ++iteration) {
      // The residual's size is taken out, so that single precision has room.
      float* right_side = multigrid_.rightSide();
      const double inverse = 1.0 / residual;
      for (long k = 4L * begin; k < 4L * end; ++k) right_side[k] = static_cast<float>(v.r[k] * inverse);
      crew.barrier();
      multigrid_.cycle(crew);
      crew.barrier();
      const float* z = multigrid_.result();
      eachNode(&v.rz, [&](long i, double* sum) {
        for (int c = 0; c < 3; ++c) *sum += v.r[i + c] * z[i + c];
      });
      crew.barrier();
      const double next = residual * total(v.rz), beta = iteration == 0 ? 0.0 : next / rz;
      rz = next;
      for (long k = 4L * begin; k < 4L * end; ++k) v.p[k] = residual * z[k] + beta * v.p[k];
      crew.barrier();
      product(crew, v.p.data());
      crew.barrier();
      eachNode(&v.pAp, [&](long i, double* sum) {
        alignas(32) double row[4];
        productRow(static_cast<int>(i / 4), v.p.data(), row);
        for (int c = 0; c < 3; ++c) {
          v.Ap[i + c] = free[i + c] * row[c];
          *sum += v.p[i + c] * v.Ap[i + c];
        }
      });
      crew.barrier();
      const double curvature = total(v.pAp);
      if (!(curvature > 0.0) || !(rz > 0.0)) {
        positive = false;
        break;
      }
      const double step = rz / curvature;
      eachNode(&v.rr, [&](long i, double* sum) {
        for (int c = 0; c < 3; ++c) {
          v.x[i + c] += step * v.p[i + c];
          v.r[i + c] -= step * v.Ap[i + c];
          *sum += v.r[i + c] * v.r[i + c];
        }
      });
      crew.barrier();
      residual = std::sqrt(total(v.rr));
    }
    for (long i = begin; i < end; ++i)
      for (int c = 0; c < 3; ++c) (*solution)[3 * i + c] = v.x[4 * i + c];
    if (crew.rank() != 0) return;
    report.iterations = iteration;
    decades_ = iteration > 0 && residual > 0.0 ? std::log10(first_residual / residual) : 0.0;
    report.positive = positive;
    report.residual = scale > 0.0 ? residual / scale : residual;
    report.converged = positive && residual <= tolerance * scale;
  });
  return report;
}

}  // namespace calipso::fem
