#include "calipso_fem/elastic_model.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>

#include "cell_coloring.hpp"
#include "element.hpp"

namespace calipso::fem {
namespace {

constexpr std::array<std::pair<ElementType, const char*>, 4> kNames = {{
    {ElementType::kHexQ1, "Q1"},
    {ElementType::kHexMeanDilatation, "mean_dilatation"},
    {ElementType::kHexEnhanced, "enhanced"},
    {ElementType::kTetP1, "P1"},
}};

CornerMatrix cornersOf(const CellMatrix& cells, int cell, const double* x) {
  CornerMatrix corners(cells.cols(), 3);
  for (int c = 0; c < cells.cols(); ++c) {
    const double* p = x + 3 * cells(cell, c);
    corners.row(c) << p[0], p[1], p[2];
  }
  return corners;
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

std::string toString(ElementType element) {
  for (const auto& [value, name] : kNames)
    if (value == element) return name;
  return "unknown";
}

ElementType elementTypeFromString(const std::string& name) {
  for (const auto& [value, known] : kNames)
    if (name == known) return value;
  throw std::invalid_argument("element '" + name +
                              "': known are Q1, mean_dilatation, enhanced, P1");
}

struct ElasticModel::Impl {
  VolumeMesh mesh;
  MaterialModel model;
  ElementType type;
  std::vector<Material> materials;             // per cell
  std::vector<std::unique_ptr<ReferenceElement>> references;
  std::vector<int> reference_of;               // per cell
  std::vector<ElementKind> kinds;
  std::vector<int> kind_of;                    // per cell
  std::shared_ptr<const BlockPattern> pattern;
  std::vector<int> block_of;                   // per cell, corners x corners
  CellColoring coloring;
  Eigen::VectorXd lumped_mass;

  void buildReferences();
  void buildKinds();
  void buildBlocks();
  void buildMass();
  template <class Work>
  void forEachCell(const Work& work) const;
  void assemble(const Vec& x, Part part, BlockMatrix& K) const;
};

// Calls work(cell) colour by colour: cells of one colour share no node, so that sums into nodes are
// free of races and always in the same order.
template <class Work>
void ElasticModel::Impl::forEachCell(const Work& work) const {
  for (std::size_t color = 0; color + 1 < coloring.start.size(); ++color) {
#pragma omp parallel for schedule(static)
    for (int k = coloring.start[color]; k < coloring.start[color + 1]; ++k)
      work(coloring.cells[k]);
  }
}

void ElasticModel::Impl::buildReferences() {
  references.clear();
  reference_of.assign(mesh.cellCount(), 0);
  std::map<std::vector<long>, int> known;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const CornerMatrix corners = cornersOf(mesh.cells, cell, mesh.nodes.data());
    const auto [it, is_new] = known.try_emplace(shapeKey(corners), references.size());
    if (is_new)
      references.push_back(std::make_unique<ReferenceElement>(makeReferenceElement(corners)));
    reference_of[cell] = it->second;
  }
}

void ElasticModel::Impl::buildKinds() {
  kinds.clear();
  kind_of.assign(mesh.cellCount(), 0);
  std::map<std::tuple<int, double, double>, int> known;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const Material& m = materials[cell];
    const auto [it, is_new] = known.try_emplace(
        {reference_of[cell], m.youngs_modulus, m.poissons_ratio}, kinds.size());
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
    for (int c = 0; c < mesh.cells.cols(); ++c) lumped_mass[mesh.cells(cell, c)] += density * rows[c];
  }
}

void ElasticModel::Impl::assemble(const Vec& x, Part part, BlockMatrix& K) const {
  if (K.pattern != pattern) K = BlockMatrix(pattern);
  K.setZero();
  const int n = static_cast<int>(mesh.cells.cols());
  forEachCell([&](int cell) {
    ElementResult r;
    evaluateElement(kinds[kind_of[cell]], cornersOf(mesh.cells, cell, x.data()), 2, part, &r);
    const int* blocks = block_of.data() + static_cast<std::size_t>(cell) * n * n;
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        K.block(blocks[a * n + b]) += mesh.fraction[cell] * r.K.block<3, 3>(3 * a, 3 * b);
  });
}

ElasticModel::ElasticModel(VolumeMesh mesh, const Material& material, MaterialModel model,
                           ElementType element)
    : impl_(std::make_unique<Impl>()) {
  validate(mesh);
  validate(material);
  if (mesh.isTetrahedral() != (element == ElementType::kTetP1))
    throw std::invalid_argument("element " + toString(element) + " does not fit cells with " +
                                std::to_string(mesh.cells.cols()) + " corners");
  impl_->materials.assign(mesh.cellCount(), material);
  impl_->mesh = std::move(mesh);
  impl_->model = model;
  impl_->type = element;
  impl_->buildReferences();
  impl_->buildKinds();
  impl_->buildBlocks();
  impl_->buildMass();
}

ElasticModel::~ElasticModel() = default;
ElasticModel::ElasticModel(ElasticModel&&) noexcept = default;

const VolumeMesh& ElasticModel::mesh() const { return impl_->mesh; }
MaterialModel ElasticModel::model() const { return impl_->model; }
ElementType ElasticModel::element() const { return impl_->type; }
int ElasticModel::dofCount() const { return 3 * impl_->mesh.nodeCount(); }
const std::vector<Material>& ElasticModel::cellMaterials() const { return impl_->materials; }

void ElasticModel::setMaterial(const Material& material) {
  setCellMaterials(std::vector<Material>(impl_->mesh.cellCount(), material));
}

void ElasticModel::setCellMaterials(const std::vector<Material>& materials) {
  if (static_cast<int>(materials.size()) != impl_->mesh.cellCount())
    throw std::invalid_argument("cell materials: " + std::to_string(materials.size()) +
                                " given, the mesh has " + std::to_string(impl_->mesh.cellCount()) +
                                " cells");
  for (const Material& material : materials) validate(material);
  impl_->materials = materials;
  impl_->buildKinds();
  impl_->buildMass();
}

void ElasticModel::setRestPositions(const NodeMatrix& nodes) {
  if (nodes.rows() != impl_->mesh.nodes.rows() || !nodes.allFinite())
    throw std::invalid_argument("rest positions: need " + std::to_string(impl_->mesh.nodeCount()) +
                                " finite points");
  const NodeMatrix before = impl_->mesh.nodes;
  impl_->mesh.nodes = nodes;
  try {
    impl_->buildReferences();
  } catch (const std::invalid_argument&) {
    impl_->mesh.nodes = before;
    impl_->buildReferences();
    impl_->buildKinds();
    throw;
  }
  impl_->buildKinds();
  impl_->buildMass();
}

double ElasticModel::energy(const Vec& x) const {
  const Impl& m = *impl_;
  Eigen::VectorXd cell_energy(m.mesh.cellCount());
  m.forEachCell([&](int cell) {
    ElementResult r;
    evaluateElement(m.kinds[m.kind_of[cell]], cornersOf(m.mesh.cells, cell, x.data()), 0,
                    Part::kFull, &r);
    cell_energy[cell] = m.mesh.fraction[cell] * r.energy;
  });
  return cell_energy.sum();
}

void ElasticModel::gradient(const Vec& x, Vec& f) const {
  const Impl& m = *impl_;
  f.setZero(dofCount());
  m.forEachCell([&](int cell) {
    ElementResult r;
    evaluateElement(m.kinds[m.kind_of[cell]], cornersOf(m.mesh.cells, cell, x.data()), 1,
                    Part::kFull, &r);
    for (int c = 0; c < m.mesh.cells.cols(); ++c)
      f.segment<3>(3 * m.mesh.cells(cell, c)) += m.mesh.fraction[cell] * r.f.segment<3>(3 * c);
  });
}

void ElasticModel::hessian(const Vec& x, Definiteness definiteness, BlockMatrix& K) const {
  impl_->assemble(x, definiteness == Definiteness::kPositive ? Part::kPositive : Part::kFull, K);
}

void ElasticModel::viscosity(const Vec& x, BlockMatrix& D) const {
  Impl& m = *impl_;
  if (D.pattern != m.pattern) D = BlockMatrix(m.pattern);
  D.setZero();
  const int n = static_cast<int>(m.mesh.cells.cols());
  m.forEachCell([&](int cell) {
    ElementKind kind = m.kinds[m.kind_of[cell]];
    if (kind.model != MaterialModel::kLinear) kind.model = MaterialModel::kStVenantKirchhoff;
    ElementResult r;
    evaluateElement(kind, cornersOf(m.mesh.cells, cell, x.data()), 2, Part::kMaterialOnly, &r);
    const int* blocks = m.block_of.data() + static_cast<std::size_t>(cell) * n * n;
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        D.block(blocks[a * n + b]) += m.mesh.fraction[cell] * r.K.block<3, 3>(3 * a, 3 * b);
  });
}

const std::shared_ptr<const BlockPattern>& ElasticModel::pattern() const { return impl_->pattern; }

Eigen::SparseMatrix<double> ElasticModel::linearStiffness() const {
  BlockMatrix K;
  hessian(restPositions(impl_->mesh), Definiteness::kExact, K);
  return K.toSparse();
}

Eigen::MatrixXd ElasticModel::elementStiffness(int cell) const {
  const Impl& m = *impl_;
  ElementResult r;
  evaluateElement(m.kinds[m.kind_of[cell]], cornersOf(m.mesh.cells, cell, m.mesh.nodes.data()), 2,
                  Part::kFull, &r);
  return m.mesh.fraction[cell] * r.K;
}

const Eigen::VectorXd& ElasticModel::lumpedMass() const { return impl_->lumped_mass; }
double ElasticModel::totalMass() const { return impl_->lumped_mass.sum(); }

BlockMatrix ElasticModel::consistentMass() const {
  const Impl& m = *impl_;
  BlockMatrix M(m.pattern);
  const int n = static_cast<int>(m.mesh.cells.cols());
  for (int cell = 0; cell < m.mesh.cellCount(); ++cell) {
    const Eigen::MatrixXd unit = unitMass(cornersOf(m.mesh.cells, cell, m.mesh.nodes.data()));
    const double density = m.materials[cell].density * m.mesh.fraction[cell];
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        M.block(m.block_of[(static_cast<std::size_t>(cell) * n + a) * n + b])
            .diagonal()
            .array() += density * unit(a, b);
  }
  return M;
}

Eigen::VectorXd ElasticModel::cellVonMises(const Vec& x) const {
  const Impl& m = *impl_;
  Eigen::VectorXd result(m.mesh.cellCount());
  m.forEachCell([&](int cell) {
    const ElementKind& kind = m.kinds[m.kind_of[cell]];
    const Eigen::Matrix3d F =
        cornersOf(m.mesh.cells, cell, x.data()).transpose() * kind.reference->center_gradient;
    result[cell] = vonMises(stress(kind.model, kind.lame, F), F);
  });
  return result;
}

Eigen::Matrix3d ElasticModel::centerGradient(int cell, const Vec& x) const {
  return cornersOf(impl_->mesh.cells, cell, x.data()).transpose() *
         impl_->references[impl_->reference_of[cell]]->center_gradient;
}

double ElasticModel::smallestDilatation(const Vec& x) const {
  const Impl& m = *impl_;
  double smallest = std::numeric_limits<double>::infinity();
  for (int cell = 0; cell < m.mesh.cellCount(); ++cell) {
    const ReferenceElement& ref = *m.references[m.reference_of[cell]];
    const CornerMatrix corners = cornersOf(m.mesh.cells, cell, x.data());
    for (int q = 0; q < ref.points; ++q)
      smallest = std::min(smallest, (corners.transpose() * ref.gradient[q]).determinant());
  }
  return smallest;
}

}  // namespace calipso::fem
