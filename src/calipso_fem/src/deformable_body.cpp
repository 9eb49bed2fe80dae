#include "calipso_fem/deformable_body.hpp"

#include <cmath>
#include <stdexcept>

#include "body_impl.hpp"
#include "threads.hpp"

namespace calipso::fem {
namespace {

using Eigen::Vector3d;

void requireSize(const Vec& given, Eigen::Index size, const std::string& what) {
  if (given.size() != size)
    throw std::invalid_argument(what + ": has " + std::to_string(given.size()) +
                                " numbers, needs " + std::to_string(size));
  if (!given.allFinite()) throw std::invalid_argument(what + ": a number is not finite");
}

void requireFinite(const Vector3d& given, const std::string& what) {
  if (!given.allFinite()) throw std::invalid_argument(what + ": a component is not finite");
}

Embedding identityEmbedding(int nodes) {
  Embedding embedding;
  embedding.weights.resize(nodes, nodes);
  embedding.weights.setIdentity();
  return embedding;
}

// Below this, a kept Cholesky factor is faster.
constexpr int kMatrixFreeNodes = 200;
constexpr int kSlowSolves = 4;  // in a row

VolumeMesh withElement(VolumeMesh hexes, ElementType element) {
  return element == ElementType::kTetP1 && !hexes.isTetrahedral() ? kuhnSplit(hexes)
                                                                  : std::move(hexes);
}

}  // namespace

// Called again when the material has changed.
void DeformableBody::Impl::chooseSolver() {
  slow_solves = 0;
  const VolumeMesh& mesh = model->mesh();
  const bool automatic = options.solver == SolverKind::kAutomatic;
  const std::vector<Material>& materials = model->cellMaterials();
  const SolverKind kind = automatic ? chooseSolverKind(mesh, materials) : options.solver;
  if (!solver || solver->kind() != kind) solver = std::make_unique<LinearSolver>(mesh, kind);
  const bool multigrid =
      options.solver == SolverKind::kMultigrid || (automatic && suitsMultigrid(materials));
  if (!multigrid || !model->hexes() || !options.lumped_mass ||
      mesh.nodeCount() < kMatrixFreeNodes || !HexSolver::fits(mesh))
    hex_solver.reset();
  else if (hex_solver)
    hex_solver->setHexes(*model->hexes());
  else
    hex_solver = std::make_unique<HexSolver>(mesh, *model->hexes());
}

// Multigrid sees badly what runs across its cells, as a folded sheet does: then a kept factor is
// faster, if it is small.
void DeformableBody::Impl::leaveSlowMultigrid() {
  if (!hex_solver || options.solver != SolverKind::kAutomatic || slow_solves < kSlowSolves) return;
  if (!hasSmallFactor(model->mesh())) return;
  hex_solver.reset();
  solver = std::make_unique<LinearSolver>(model->mesh(), SolverKind::kStaleCholesky);
}

void DeformableBody::Impl::initialise(const Material& material) {
  (void)material;
  setThreads(options.threads);
  if (!options.lumped_mass) mass = model->consistentMass();
  chooseSolver();
  x = restPositions(model->mesh());
  v = a = reactions = Vec::Zero(x.size());
}

void DeformableBody::Impl::invalidatePreconditioner() {
  solver->invalidate();
  if (hex_solver) hex_solver->invalidate();
}

void DeformableBody::Impl::invalidateSystem() {
  invalidatePreconditioner();
  system_valid = false;
  if (mass) mass = model->consistentMass();
}

void DeformableBody::Impl::modelChanged() {
  chooseSolver();
  elastic.y.resize(0);
  viscosity_valid = false;
  viscous_velocity.resize(0);
  invalidateSystem();
}

DeformableBody::DeformableBody(const TriangleMesh& surface, const Material& material,
                               const FemOptions& options)
    : impl_(std::make_unique<Impl>()) {
  validate(options);
  VoxelizeOptions voxels;
  voxels.cell_size = options.cell_size;
  voxels.target_nodes = options.target_nodes;
  voxels.has_anchor = options.has_anchor;
  voxels.anchor = options.anchor;
  impl_->options = options;
  impl_->grid = voxelize(surface, voxels);
  impl_->embedding = embed(surface.vertices, impl_->grid);
  impl_->surface_triangles = surface.triangles;
  impl_->model = std::make_unique<ElasticModel>(withElement(impl_->grid.mesh(), options.element),
                                                material, options.material_model, options.element);
  impl_->initialise(material);
}

DeformableBody::DeformableBody(VolumeMesh mesh, const Material& material, const FemOptions& options)
    : impl_(std::make_unique<Impl>()) {
  validate(options);
  impl_->options = options;
  impl_->embedding = identityEmbedding(mesh.nodeCount());
  impl_->model = std::make_unique<ElasticModel>(withElement(std::move(mesh), options.element),
                                                material, options.material_model, options.element);
  impl_->initialise(material);
}

DeformableBody::~DeformableBody() = default;
DeformableBody::DeformableBody(DeformableBody&&) noexcept = default;

const ElasticModel& DeformableBody::model() const { return *impl_->model; }
const Embedding& DeformableBody::embedding() const { return impl_->embedding; }
const VoxelGrid& DeformableBody::grid() const { return impl_->grid; }
const FemOptions& DeformableBody::options() const { return impl_->options; }
int DeformableBody::nodeCount() const { return impl_->model->mesh().nodeCount(); }
double DeformableBody::time() const { return impl_->time; }
const Vec& DeformableBody::positions() const { return impl_->x; }
const Vec& DeformableBody::velocities() const { return impl_->v; }

void DeformableBody::setState(const Vec& positions, const Vec& velocities) {
  requireSize(positions, impl_->x.size(), "positions");
  requireSize(velocities, impl_->x.size(), "velocities");
  impl_->x = positions;
  impl_->v = velocities;
  impl_->acceleration_known = false;
  impl_->previous.reset();
}

void DeformableBody::setRigidVelocity(const Vector3d& linear, const Vector3d& angular) {
  requireFinite(linear, "linear velocity");
  requireFinite(angular, "angular velocity");
  const Vector3d center = momentum().center;
  for (int k = 0; k < nodeCount(); ++k)
    impl_->v.segment<3>(3 * k) = linear + angular.cross(impl_->x.segment<3>(3 * k) - center);
  impl_->acceleration_known = false;
  impl_->previous.reset();
}

void DeformableBody::applyRigidTransform(const Eigen::Isometry3d& transform) {
  if (!transform.matrix().allFinite())
    throw std::invalid_argument("rigid transform: an entry is not finite");
  for (int k = 0; k < nodeCount(); ++k) {
    impl_->x.segment<3>(3 * k) = transform * Vector3d(impl_->x.segment<3>(3 * k));
    impl_->v.segment<3>(3 * k) = transform.linear() * Vector3d(impl_->v.segment<3>(3 * k));
  }
  impl_->acceleration_known = false;
  impl_->previous.reset();
  impl_->invalidatePreconditioner();
}

void DeformableBody::reset() {
  impl_->x = restPositions(impl_->model->mesh());
  impl_->v.setZero();
  impl_->acceleration_known = false;
  impl_->previous.reset();
  impl_->time = 0.0;
  impl_->invalidatePreconditioner();
}

void DeformableBody::setMaterial(const Material& material) {
  impl_->model->setMaterial(material);
  impl_->modelChanged();
}

void DeformableBody::setCellMaterials(const std::vector<Material>& materials) {
  impl_->model->setCellMaterials(materials);
  impl_->modelChanged();
}

void DeformableBody::setGravity(const Vector3d& gravity) {
  requireFinite(gravity, "gravity");
  impl_->gravity = gravity;
}

void DeformableBody::setRestNodes(const NodeMatrix& nodes) {
  impl_->model->setRestPositions(nodes);
  impl_->modelChanged();
}

void DeformableBody::setTolerances(int newton_iterations, double newton_tolerance,
                                   double linear_tolerance) {
  FemOptions changed = impl_->options;
  changed.newton_iterations = newton_iterations;
  changed.newton_tolerance = newton_tolerance;
  changed.linear_tolerance = linear_tolerance;
  validate(changed);
  impl_->options = changed;
}

void DeformableBody::setNodalForces(const Vec& forces) {
  requireSize(forces, impl_->x.size(), "nodal forces");
  impl_->nodal_forces = forces;
}

void DeformableBody::setSurfaceForces(const Vec& forces) {
  requireSize(forces, 3 * impl_->embedding.vertexCount(), "surface forces");
  impl_->surface_forces = forces;
}

void DeformableBody::setSoftConstraints(std::vector<SoftConstraint> constraints) {
  impl_->soft.clear();
  for (SoftConstraint& c : constraints) {
    requireFinite(c.target, "soft constraint's target");
    requireFinite(c.direction, "soft constraint's direction");
    requireFinite(c.target_velocity, "soft constraint's target velocity");
    if (!(c.stiffness >= 0.0) || !(c.damping >= 0.0) || !std::isfinite(c.stiffness + c.damping))
      throw std::invalid_argument("soft constraint: stiffness and damping must be >= 0 and finite");
    Eigen::SparseVector<double> weights = impl_->embedding.pointWeights(c.point);
    impl_->soft.push_back({std::move(c), std::move(weights)});
  }
}

void DeformableBody::setPressure(double pressure) {
  if (!std::isfinite(pressure))
    throw std::invalid_argument("pressure is " + std::to_string(pressure) +
                                " Pa, allowed is any finite value");
  impl_->pressure = pressure;
}

Vector3d DeformableBody::softConstraintForce(int index) const {
  if (index < 0 || 3 * index >= impl_->soft_forces.size())
    throw std::invalid_argument("soft constraint " + std::to_string(index) +
                                " has not taken part in a step");
  return impl_->soft_forces.segment<3>(3 * index);
}

}  // namespace calipso::fem
