#include "calipso_align/fem_stage.hpp"

#include <Eigen/CholmodSupport>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calipso_fem/blas_threads.hpp"

namespace calipso::align {
namespace {

using fem::BlockMatrix;
using fem::Vec;

// Nodes and weights that carry one vertex, nodes ascending, and where the blocks of their pairs (i,
// j), i <= j, are: row by row.
struct Carrier {
  int nodes[8];
  double weights[8];
  int blocks[36];
  int count = 0;
};

std::vector<Carrier> carriersOf(const fem::Embedding& embedding, const fem::BlockPattern& pattern) {
  std::vector<Carrier> carriers(embedding.vertexCount());
  for (int v = 0; v < embedding.vertexCount(); ++v) {
    Carrier& c = carriers[v];
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(embedding.weights, v); it;
         ++it) {
      if (it.value() == 0.0 || c.count == 8) continue;
      c.nodes[c.count] = static_cast<int>(it.col());
      c.weights[c.count++] = it.value();
    }
    int* block = c.blocks;
    for (int i = 0; i < c.count; ++i) {
      for (int j = i; j < c.count; ++j) *block++ = pattern.find(c.nodes[i], c.nodes[j]);
    }
  }
  return carriers;
}

// Smallest volume that three edges of a cell span at one of its corners.
double smallestCornerVolume(const fem::VolumeMesh& mesh) {
  double smallest = std::numeric_limits<double>::max();
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    for (int c = 0; c < 8; ++c) {
      Eigen::Matrix3d edges;
      for (int k = 0; k < 3; ++k) {
        const int low = c & ~(1 << k), high = c | (1 << k);
        edges.col(k) = mesh.node(mesh.cells(cell, high)) - mesh.node(mesh.cells(cell, low));
      }
      smallest = std::min(smallest, edges.determinant());
    }
  }
  return smallest;
}

// The affine map that comes closest to taking `from` to `to`, applied to `from`.
Points affinePart(const Points& from, const Points& to) {
  const Eigen::RowVector3d a = from.colwise().mean(), b = to.colwise().mean();
  const Points d = from.rowwise() - a;
  const Eigen::Matrix3d normal = d.transpose() * d, cross = d.transpose() * (to.rowwise() - b);
  return (d * normal.ldlt().solve(cross)).rowwise() + b;
}

// The grid's mesh at rest where the fit stands: the low-order deformation costs nothing any more. A
// bend that would fold cells, which can reach beyond the model's surface, is taken back as far as
// they ask for.
fem::VolumeMesh restMesh(const fem::VoxelGrid& grid, const Points& placed) {
  constexpr double kLeastVolume = 0.1;  // of the cells' volume
  fem::VolumeMesh mesh = grid.mesh();
  const Points affine = affinePart(mesh.nodes, placed);
  mesh.nodes = affine;
  mesh.lattice.resize(0, 3);
  const double least = kLeastVolume * smallestCornerVolume(mesh);
  for (const double bend : {1.0, 0.75, 0.5, 0.25, 0.0}) {
    mesh.nodes = affine + bend * (placed - affine);
    if (smallestCornerVolume(mesh) > least) break;
  }
  return mesh;
}

Vec vectorOf(const Points& nodes) { return Eigen::Map<const Vec>(nodes.data(), nodes.size()); }

Material unitMaterial(double poissons_ratio) {
  Material material;
  material.youngs_modulus = 1.0;
  material.poissons_ratio = poissons_ratio;
  material.density = 1.0;
  return material;
}

}  // namespace

struct ElasticFit::Impl {
  FemStageOptions options;
  fem::VoxelGrid grid;
  fem::Embedding embedding;
  Vec x, x0;  // current and starting nodal positions, 3n
  int free;   // coordinates of a node that move: x, y, and z unless it is held
  fem::ElasticModel model;
  BlockMatrix K;  // of the linear model, which never changes; else of the last call
  std::vector<Carrier> carriers;
  double volume, size;            // m^3, m
  Eigen::SparseMatrix<double> A;  // lower half of the free coordinates' system
  Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver;

  Impl(const TriangleMesh& cad, const fem::VoxelGrid& g,
       const std::function<Points(const Points&)>& placed, const FemStageOptions& o)
      : options(o),
        grid(g),
        embedding(fem::embed(cad.vertices, grid)),
        x(vectorOf(placed(grid.nodes))),
        x0(x),
        free(o.hold_depth ? 2 : 3),
        model(restMesh(grid, Eigen::Map<const Points>(x.data(), grid.nodeCount(), 3)),
              unitMaterial(o.poissons_ratio),
              o.linear ? fem::MaterialModel::kLinear : fem::MaterialModel::kCorotated,
              fem::ElementType::kHexQ1),
        K(model.pattern()),
        carriers(carriersOf(embedding, *model.pattern())),
        volume(model.totalMass()),
        size(boundingDiagonal(cad)) {
    makePattern();
    if (options.linear) model.viscosity(x, K);
  }

  Points vertices() const {
    const Vec s = embedding.apply(x);
    return Eigen::Map<const Points>(s.data(), s.size() / 3, 3);
  }

  double lambda(int iteration) const {
    const auto& weights = options.elastic_weights;
    return weights[std::min<size_t>(iteration, weights.size() - 1)] / volume;
  }
  double driftInformation() const {
    return 1.0 / (options.drift_sigma * options.drift_sigma * size * size * grid.nodeCount());
  }

  // Adds the measurements' gradient J^T W r, and a bound of J^T W J that stays inside K's pattern:
  // (sum of a_k x_k)^2 <= sum of a_k x_k^2, each vertex in one cell. Of H's blocks only those on
  // and above the diagonal, which solve() reads.
  void addRows(const Rows& rows, Vec& gradient, BlockMatrix& H) const;
  void addVertex(int vertex, double share, const PointRow& row, BlockMatrix& H) const;
  void makePattern();
  void addDrift(Vec& gradient, BlockMatrix& H) const;
  // Nothing where the system is not positive definite.
  std::optional<Vec> solve(const BlockMatrix& H, const Vec& gradient);
  // Stiffens a system that is not positive definite until it is.
  std::optional<Vec> dampedStep(BlockMatrix& H, const Vec& gradient, FemStageReport& report);
  double energy(const Vec& at, const Vec& from, const Rows& rows, double weight) const;
  Vec lineSearch(const Vec& step, const Rows& rows, double weight, double slope) const;
};

void ElasticFit::Impl::addVertex(int vertex, double share, const PointRow& row,
                                 BlockMatrix& H) const {
  const Carrier& c = carriers[vertex];
  const Eigen::Matrix3d outer = share * row.weight * row.g * row.g.transpose();
  const int* block = c.blocks;
  for (int i = 0; i < c.count; ++i) {
    for (int j = i; j < c.count; ++j) H.block(*block++) += c.weights[i] * c.weights[j] * outer;
  }
}

void ElasticFit::Impl::addRows(const Rows& rows, Vec& gradient, BlockMatrix& H) const {
  for (const PointRow& row : rows) {
    if (row.weight == 0.0) continue;
    for (int k = 0; k < 3; ++k) {
      if (row.a[k] == 0.0) continue;
      const Carrier& c = carriers[row.v[k]];
      const Eigen::Vector3d f = row.a[k] * row.weight * row.r * row.g;
      for (int i = 0; i < c.count; ++i) gradient.segment<3>(3 * c.nodes[i]) += c.weights[i] * f;
      addVertex(row.v[k], row.a[k], row, H);
    }
  }
}

// The lower half's pattern: column `free j + c` holds the blocks (i, j), i >= j, from its diagonal
// down.
void ElasticFit::Impl::makePattern() {
  const fem::BlockPattern& p = *model.pattern();
  A.resize(free * p.rows(), free * p.rows());
  A.resizeNonZeros(free * free * (p.blockCount() + p.rows()) / 2 - (free == 3 ? 3 : 1) * p.rows());
  int count = 0;
  for (int j = 0; j < p.rows(); ++j) {
    for (int c = 0; c < free; ++c) {
      A.outerIndexPtr()[free * j + c] = count;
      for (int k = p.diagonal[j]; k < p.row_start[j + 1]; ++k) {
        for (int r = k == p.diagonal[j] ? c : 0; r < free; ++r) {
          A.innerIndexPtr()[count++] = free * p.column[k] + r;
        }
      }
    }
  }
  A.outerIndexPtr()[free * p.rows()] = count;
  std::fill_n(A.valuePtr(), count, 1.0);
  fem::useOneBlasThread();
  solver.cholmod().print = 0;  // what it would print, the report says
  solver.analyzePattern(A);
}

void ElasticFit::Impl::addDrift(Vec& gradient, BlockMatrix& H) const {
  const double information = driftInformation();
  gradient += information * (x - x0);
  for (int i = 0; i < grid.nodeCount(); ++i) {
    H.block(H.pattern->diagonal[i]).diagonal().array() += information;
  }
}

std::optional<Vec> ElasticFit::Impl::dampedStep(BlockMatrix& H, const Vec& gradient,
                                                FemStageReport& report) {
  std::optional<Vec> step = solve(H, gradient);
  if (step) return step;
  double mean = 0.0;
  for (int i = 0; i < grid.nodeCount(); ++i) mean += H.block(H.pattern->diagonal[i]).trace();
  mean /= 3.0 * grid.nodeCount();
  for (double damping = 1e-6; damping < 10.0 && !step && std::isfinite(mean); damping *= 100.0) {
    for (int i = 0; i < grid.nodeCount(); ++i) {
      H.block(H.pattern->diagonal[i]).diagonal().array() += damping * mean;
    }
    step = solve(H, gradient);
  }
  if (step) ++report.damped;
  return step;
}

std::optional<Vec> ElasticFit::Impl::solve(const BlockMatrix& H, const Vec& gradient) {
  const fem::BlockPattern& p = *H.pattern;
  double* value = A.valuePtr();
  for (int j = 0; j < p.rows(); ++j) {
    for (int c = 0; c < free; ++c) {
      for (int k = p.diagonal[j]; k < p.row_start[j + 1]; ++k) {
        for (int r = k == p.diagonal[j] ? c : 0; r < free; ++r) *value++ = H.block(k)(c, r);
      }
    }
  }
  solver.factorize(A);
  if (solver.info() != Eigen::Success) return std::nullopt;
  Eigen::Map<const Points> g(gradient.data(), p.rows(), 3);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> b = -g.leftCols(free);
  const Vec solution = solver.solve(Eigen::Map<const Vec>(b.data(), b.size()));
  Points step = Points::Zero(p.rows(), 3);
  step.leftCols(free) = Eigen::Map<const decltype(b)>(solution.data(), p.rows(), free);
  if (!step.allFinite()) return std::nullopt;
  return vectorOf(step);
}

// Energy at `at`, with measurements linearised at `from`.
double ElasticFit::Impl::energy(const Vec& at, const Vec& from, const Rows& rows,
                                double weight) const {
  double sum = weight * model.energy(at);
  const Vec moved = embedding.apply(at - from);
  for (const PointRow& row : rows) {
    double r = row.r;
    for (int k = 0; k < 3; ++k)
      if (row.a[k] != 0.0) r += row.a[k] * row.g.dot(moved.segment<3>(3 * row.v[k]));
    sum += 0.5 * row.weight * r * r;
  }
  return sum + 0.5 * driftInformation() * (at - x0).squaredNorm();
}

// The longest of the steps 1, 1/2, 1/4 ... that lowers the energy enough (Armijo).
Vec ElasticFit::Impl::lineSearch(const Vec& step, const Rows& rows, double weight,
                                 double slope) const {
  constexpr double kArmijo = 1e-4;
  if (options.linear) return step;  // the energy is the quadratic form that the step minimises
  const double start = energy(x, x, rows, weight);
  for (double t = 1.0; t > 0.01; t *= 0.5) {
    if (energy(x + t * step, x, rows, weight) <= start + kArmijo * t * slope) return t * step;
  }
  return Vec::Zero(step.size());
}

fem::VoxelGrid gridOf(const TriangleMesh& cad, int nodes) {
  // The size of the cells is found with few sight lines, which count nearly the same nodes.
  fem::VoxelizeOptions options;
  options.target_nodes = nodes;
  options.samples_per_edge = 2;
  options.cell_size = fem::voxelize(cad, options).cell_size;
  options.samples_per_edge = 6;
  return fem::voxelize(cad, options);
}

ElasticFit::ElasticFit(const TriangleMesh& cad, const fem::VoxelGrid& grid,
                       const std::function<Points(const Points&)>& placed,
                       const FemStageOptions& options)
    : impl_(std::make_shared<Impl>(cad, grid, placed, options)) {}

FemStageReport ElasticFit::fit(const std::function<Rows(const Points&, int)>& observe) {
  Impl& m = *impl_;
  FemStageReport report;
  report.nodes = m.grid.nodeCount();
  const int iterations = static_cast<int>(m.options.elastic_weights.size());
  for (; report.iterations < iterations && !report.converged; ++report.iterations) {
    const double weight = m.lambda(report.iterations);
    const Rows rows = observe(m.vertices(), report.iterations);

    // (lambda K + J^T W J + eps) delta = -g
    Vec gradient;
    m.model.gradient(m.x, gradient);
    gradient *= weight;
    if (!m.options.linear) m.model.viscosity(m.x, m.K);
    BlockMatrix H = m.K;
    for (double& value : H.values) value *= weight;
    m.addRows(rows, gradient, H);
    m.addDrift(gradient, H);
    const std::optional<Vec> step = m.dampedStep(H, gradient, report);
    report.solvable = step.has_value();
    if (!step) break;
    const Vec taken = m.lineSearch(*step, rows, weight, gradient.dot(*step));
    m.x += taken;
    const bool last_weight =
        report.iterations + 1 >= iterations ||
        m.options.elastic_weights[report.iterations] == m.options.elastic_weights.back();
    report.converged =
        last_weight && taken.lpNorm<Eigen::Infinity>() < m.options.smallest_step * m.size;
  }
  return report;
}

Points ElasticFit::vertices() const { return impl_->vertices(); }

Points ElasticFit::carry(const Points& object_points) const {
  const Vec s = fem::embed(object_points, impl_->grid).apply(impl_->x);
  return Eigen::Map<const Points>(s.data(), s.size() / 3, 3);
}

}  // namespace calipso::align
