#include "calipso_fem/elastic_model.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <stdexcept>

#include "elastic_model_impl.hpp"

namespace calipso::fem {
namespace {

constexpr std::array<std::pair<ElementType, const char*>, 4> kNames = {{
    {ElementType::kHexQ1, "Q1"},
    {ElementType::kHexMeanDilatation, "mean_dilatation"},
    {ElementType::kHexEnhanced, "enhanced"},
    {ElementType::kTetP1, "P1"},
}};

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

ElementResult ElasticModel::Impl::evaluate(int cell, const Vec& x, int derivatives,
                                           Part part) const {
  ElementResult r;
  evaluateElement(kinds[kind_of[cell]], cornersOf(mesh.cells, cell, x.data()), derivatives, part,
                  &r);
  return r;
}

void ElasticModel::Impl::addToMatrix(int cell, const ElementResult& r, BlockMatrix& K) const {
  const int n = static_cast<int>(mesh.cells.cols());
  const int* blocks = block_of.data() + static_cast<std::size_t>(cell) * n * n;
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < n; ++b)
      K.block(blocks[a * n + b]) += mesh.fraction[cell] * r.K.block<3, 3>(3 * a, 3 * b);
}

void ElasticModel::Impl::addToMatrix(int cell, int lane, const StvkBatchResult& r,
                                     BlockMatrix& K) const {
  const int* blocks = block_of.data() + static_cast<std::size_t>(cell) * 64;
  const double fraction = mesh.fraction[cell];
  int pair = 0;
  for (int a = 0; a < 8; ++a)
    for (int b = a; b < 8; ++b, ++pair) {
      double* upper = K.values.data() + 9 * static_cast<std::size_t>(blocks[8 * a + b]);
      double* lower = K.values.data() + 9 * static_cast<std::size_t>(blocks[8 * b + a]);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          const double value = fraction * r.K[pair][3 * i + j][lane];
          upper[3 * i + j] += value;
          if (a != b) lower[3 * j + i] += value;
        }
    }
}

void ElasticModel::Impl::assemble(const Vec& x, Part part, BlockMatrix& K) const {
  if (K.pattern != pattern) K = BlockMatrix(pattern);
  K.setZero();
  if (!isBatched()) {
    forEachCell([&](int cell) { addToMatrix(cell, evaluate(cell, x, 2, part), K); });
    return;
  }
  const StvkPart stvk_part = part == Part::kFull       ? StvkPart::kFull
                             : part == Part::kPositive ? StvkPart::kPositive
                                                       : StvkPart::kMaterialOnly;
  forEachBatched(x, 2, stvk_part, [&](int cell, int lane, const StvkBatchResult& r) {
    if (r.smallest_dilatation[lane] < kRecoveryDilatation && part != Part::kMaterialOnly)
      addToMatrix(cell, evaluate(cell, x, 2, part), K);
    else
      addToMatrix(cell, lane, r, K);
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
  impl_->buildBatches();
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
  impl_->buildBatches();
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
  impl_->buildBatches();
  impl_->buildMass();
}

double ElasticModel::energy(const Vec& x) const {
  const Impl& m = *impl_;
  if (m.hexes) {
    HexEvaluation evaluation;
    m.hexes->evaluate(x, false, false, &evaluation);
    return evaluation.energy;
  }
  Eigen::VectorXd cell_energy(m.mesh.cellCount());
  m.forEachCell([&](int cell) { cell_energy[cell] = m.evaluate(cell, x, 0, Part::kFull).energy; });
  return cell_energy.dot(m.mesh.fraction);
}

void ElasticModel::gradient(const Vec& x, Vec& f) const {
  const Impl& m = *impl_;
  if (m.hexes) {
    HexEvaluation evaluation;
    m.hexes->evaluate(x, false, false, &evaluation);
    f = std::move(evaluation.forces);
    return;
  }
  f.setZero(dofCount());
  m.forEachCell([&](int cell) {
    const ElementResult r = m.evaluate(cell, x, 1, Part::kFull);
    for (int c = 0; c < m.mesh.cells.cols(); ++c)
      f.segment<3>(3 * m.mesh.cells(cell, c)) += m.mesh.fraction[cell] * r.f.segment<3>(3 * c);
  });
}

void ElasticModel::hessian(const Vec& x, Definiteness definiteness, BlockMatrix& K) const {
  impl_->assemble(x, definiteness == Definiteness::kPositive ? Part::kPositive : Part::kFull, K);
}

void ElasticModel::viscosity(const Vec& x, BlockMatrix& D) const {
  const Impl& m = *impl_;
  if (m.isBatched()) return m.assemble(x, Part::kMaterialOnly, D);
  if (D.pattern != m.pattern) D = BlockMatrix(m.pattern);
  D.setZero();
  m.forEachCell([&](int cell) {
    ElementKind kind = m.kinds[m.kind_of[cell]];
    if (kind.model != MaterialModel::kLinear) kind.model = MaterialModel::kStVenantKirchhoff;
    ElementResult r;
    evaluateElement(kind, cornersOf(m.mesh.cells, cell, x.data()), 2, Part::kMaterialOnly, &r);
    m.addToMatrix(cell, r, D);
  });
}

const StvkHexes* ElasticModel::hexes() const { return impl_->hexes.get(); }

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
        M.block(m.block_of[(static_cast<std::size_t>(cell) * n + a) * n + b]).diagonal().array() +=
            density * unit(a, b);
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
