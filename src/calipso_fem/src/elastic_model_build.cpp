#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "elastic_model_impl.hpp"

// What an elastic model keeps beside its mesh: shared reference elements, kinds, batches, masses.
namespace calipso::fem {
namespace {

StvkBatchKind makeBatchKind(const ElementKind& kind) {
  StvkBatchKind b{};
  const ReferenceElement& ref = *kind.reference;
  for (int q = 0; q < 8; ++q) {
    b.weight[q] = ref.weight[q];
    for (int a = 0; a < 8; ++a)
      for (int c = 0; c < 3; ++c) b.gradient[q][a][c] = ref.gradient[q](a, c);
    for (int k = 0; k < 3; ++k)
      for (int c = 0; c < 3; ++c) b.mode[q][k][c] = ref.mode[q][3 * k](0, c);
  }
  b.lambda = kind.lame.lambda;
  b.mu = kind.lame.mu;
  b.enhanced = kind.type == ElementType::kHexEnhanced;
  if (!b.enhanced) return b;
  for (int i = 0; i < kGradientModes; ++i)
    for (int j = 0; j < kGradientModes; ++j)
      b.mode_inverse[i][j] = kind.mode_stiffness_inverse(i, j);
  return b;
}

// Cells whose corners lie alike, to a billionth of their size, share a reference element.
std::vector<long> shapeKey(const CornerMatrix& corners) {
  std::vector<long> key;
  const CornerMatrix edges = corners.rowwise() - corners.row(0).eval();
  const double size = edges.rowwise().norm().maxCoeff();
  int exponent = 0;
  std::frexp(size, &exponent);
  const double unit = std::ldexp(1.0, exponent) * 1e-9;
  key.push_back(exponent);
  for (int i = 0; i < edges.size(); ++i) key.push_back(std::lround(edges.data()[i] / unit));
  return key;
}

}  // namespace

void ElasticModel::Impl::buildReferences() {
  references.clear();
  reference_of.assign(mesh.cellCount(), 0);
  std::map<std::vector<long>, int> known;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const CornerMatrix corners = cornersOf(mesh.cells, cell, mesh.nodes.data());
    std::vector<long> key = shapeKey(corners);
    const bool spread = mesh.point_share.rows() > 0;
    if (spread)
      for (int q = 0; q < 8; ++q) key.push_back(std::lround(1e6 * mesh.point_share(cell, q)));
    const auto [it, is_new] = known.try_emplace(std::move(key), references.size());
    if (is_new) {
      references.push_back(std::make_unique<ReferenceElement>(makeReferenceElement(corners)));
      if (spread) spreadWeights(mesh.point_share.row(cell), references.back().get());
    }
    reference_of[cell] = it->second;
  }
}

void ElasticModel::Impl::buildKinds() {
  kinds.clear();
  kind_of.assign(mesh.cellCount(), 0);
  std::map<std::tuple<int, double, double>, int> known;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const Material& m = materials[cell];
    const auto [it, is_new] =
        known.try_emplace({reference_of[cell], m.youngs_modulus, m.poissons_ratio}, kinds.size());
    if (is_new)
      kinds.push_back(
          makeElementKind(*references[reference_of[cell]], type, model, lameParameters(m)));
    kind_of[cell] = it->second;
  }
}

void ElasticModel::Impl::buildBlocks() {
  pattern = makeBlockPattern(mesh.cells, mesh.nodeCount());
  coloring = colorCells(mesh.cells, mesh.nodeCount());
  const int n = static_cast<int>(mesh.cells.cols());
  block_of.resize(static_cast<std::size_t>(mesh.cellCount()) * n * n);
  for (int cell = 0; cell < mesh.cellCount(); ++cell)
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        block_of[(static_cast<std::size_t>(cell) * n + a) * n + b] =
            pattern->find(mesh.cells(cell, a), mesh.cells(cell, b));
}

void ElasticModel::Impl::buildMass() {
  lumped_mass.setZero(mesh.nodeCount());
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const Eigen::VectorXd rows =
        unitMass(cornersOf(mesh.cells, cell, mesh.nodes.data())).rowwise().sum();
    const double density = materials[cell].density * mesh.fraction[cell];
    for (int c = 0; c < mesh.cells.cols(); ++c)
      lumped_mass[mesh.cells(cell, c)] += density * rows[c];
  }
}

void ElasticModel::Impl::buildBatches() {
  batches.clear();
  batch_kinds.clear();
  batch_start.assign(1, 0);
  if (model != MaterialModel::kStVenantKirchhoff ||
      (type != ElementType::kHexEnhanced && type != ElementType::kHexQ1))
    return;
  hexes = std::make_unique<StvkHexes>(mesh, kinds, kind_of);
  for (const ElementKind& kind : kinds) batch_kinds.push_back(makeBatchKind(kind));
  for (std::size_t color = 0; color + 1 < coloring.start.size(); ++color) {
    std::vector<int> cells(coloring.cells.begin() + coloring.start[color],
                           coloring.cells.begin() + coloring.start[color + 1]);
    std::stable_sort(cells.begin(), cells.end(),
                     [this](int a, int b) { return kind_of[a] < kind_of[b]; });
    for (std::size_t k = 0; k < cells.size();) {
      Batch batch{};
      const int kind = kind_of[cells[k]];
      while (batch.count < kLanes && k < cells.size() && kind_of[cells[k]] == kind)
        batch.cell[batch.count++] = cells[k++];
      for (int l = batch.count; l < kLanes; ++l) batch.cell[l] = batch.cell[batch.count - 1];
      batches.push_back(batch);
    }
    batch_start.push_back(static_cast<int>(batches.size()));
  }
}

}  // namespace calipso::fem
