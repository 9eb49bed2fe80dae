#include <Eigen/Geometry>
#include <cmath>

#include "body_impl.hpp"

// The incremental potential of one step and its derivatives:
//   Phi(y) = inertia/2 |y - predicted|_M^2 + W(y) + rate/2 |y - base|_D^2 + springs - F . y
namespace calipso::fem {
namespace {

using Eigen::Vector3d;

Vector3d pointOn(const Vec& y, const Eigen::SparseVector<double>& weights) {
  Vector3d p = Vector3d::Zero();
  for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
    p += it.value() * y.segment<3>(3 * it.index());
  return p;
}

Eigen::Matrix3d projector(const SoftConstraint& c) {
  if (c.direction.isZero()) return Eigen::Matrix3d::Identity();
  const Vector3d n = c.direction.normalized();
  return n * n.transpose();
}

// Force of one spring and damper on its point.
Vector3d springForce(const SoftTerm& term, const Vec& y, const Integrator& i) {
  const SoftConstraint& c = term.constraint;
  const Vector3d p = pointOn(y, term.weights);
  Vector3d force = c.stiffness * (c.target - p);
  if (c.damping > 0.0 && i.rate > 0.0)
    force += c.damping * (c.target_velocity - i.rate * (p - pointOn(i.base, term.weights)));
  return projector(c) * force;
}

}  // namespace

Vec DeformableBody::Impl::applyMass(const Vec& y) const {
  if (mass) {
    Vec result;
    mass->multiply(y, result);
    return result;
  }
  const Eigen::VectorXd& m = model->lumpedMass();
  Vec result(y.size());
  for (int k = 0; k < m.size(); ++k) result.segment<3>(3 * k) = m[k] * y.segment<3>(3 * k);
  return result;
}

Vec DeformableBody::Impl::pressureForces() const {
  const Vec s = embedding.apply(x);
  Vec f = Vec::Zero(s.size());
  for (int face = 0; face < surface_triangles.rows(); ++face) {
    const Eigen::RowVector3i t = surface_triangles.row(face);
    const Vector3d a = s.segment<3>(3 * t[0]), b = s.segment<3>(3 * t[1]),
                   c = s.segment<3>(3 * t[2]);
    const Vector3d force = -pressure / 6.0 * (b - a).cross(c - a);  // a third per corner
    for (int k = 0; k < 3; ++k) f.segment<3>(3 * t[k]) += force;
  }
  return embedding.applyTransposed(f);
}

Vec DeformableBody::Impl::externalForces() const {
  Vec f(x.size());
  const Eigen::VectorXd& m = model->lumpedMass();
  for (int k = 0; k < m.size(); ++k) f.segment<3>(3 * k) = m[k] * gravity;
  if (nodal_forces.size() > 0) f += nodal_forces;
  if (surface_forces.size() > 0) f += embedding.applyTransposed(surface_forces);
  if (pressure != 0.0) f += pressureForces();
  return f;
}

Vec DeformableBody::Impl::prescribedTargets(double t) const {
  Vec targets = x;
  const Vec rest = restPositions(model->mesh());
  for (const auto& [dof, p] : prescribed) targets[dof] = rest[dof] + p.displacement(t);
  return targets;
}

void DeformableBody::Impl::maskResidual(Vec* r) const {
  for (const auto& [dof, p] : prescribed) (*r)[dof] = 0.0;
}

double DeformableBody::Impl::softEnergy(const Vec& y, const Integrator& i) const {
  double energy = 0.0;
  for (const SoftTerm& term : soft) {
    const SoftConstraint& c = term.constraint;
    const Eigen::Matrix3d N = projector(c);
    const Vector3d p = pointOn(y, term.weights);
    energy += 0.5 * c.stiffness * (N * (p - c.target)).squaredNorm();
    if (c.damping > 0.0 && i.rate > 0.0) {
      const Vector3d slip = i.rate * (p - pointOn(i.base, term.weights)) - c.target_velocity;
      energy += 0.5 * c.damping / i.rate * (N * slip).squaredNorm();
    }
  }
  return energy;
}

void DeformableBody::Impl::addSoftGradient(const Vec& y, const Integrator& i, Vec* r) const {
  for (const SoftTerm& term : soft) {
    const Vector3d force = springForce(term, y, i);
    for (Eigen::SparseVector<double>::InnerIterator it(term.weights); it; ++it)
      r->segment<3>(3 * it.index()) -= it.value() * force;
  }
}

void DeformableBody::Impl::addSoftHessian(const Integrator& i, BlockMatrix* K) const {
  for (const SoftTerm& term : soft) {
    const SoftConstraint& c = term.constraint;
    const Eigen::Matrix3d block = (c.stiffness + i.rate * c.damping) * projector(c);
    for (Eigen::SparseVector<double>::InnerIterator p(term.weights); p; ++p)
      for (Eigen::SparseVector<double>::InnerIterator q(term.weights); q; ++q) {
        const int k = K->pattern->tryFind(static_cast<int>(p.index()), static_cast<int>(q.index()));
        // A point between two cells may couple nodes outside of the pattern: their share goes to
        // the diagonal, which keeps the system positive and Newton's limit unchanged.
        K->block(k >= 0 ? k : K->pattern->diagonal[p.index()]) += p.value() * q.value() * block;
      }
  }
}

void DeformableBody::Impl::rememberSoftForces(const Integrator& i) {
  soft_forces.resize(3 * soft.size());
  for (std::size_t k = 0; k < soft.size(); ++k)
    soft_forces.segment<3>(3 * k) = springForce(soft[k], x, i);
}

void DeformableBody::Impl::evaluateHexes(const Vec& y, bool stresses, bool positive) const {
  ElasticState& e = elastic;
  model->hexes()->evaluate(y, stresses, positive, &e.hex);
  e.y = y;
  e.energy = e.hex.energy;
  e.dilatation = e.hex.dilatation;
  e.forces.swap(e.hex.forces);
  e.has_energy = e.has_forces = e.has_dilatation = true;
  e.has_stresses = stresses;
  e.positive = positive;
}

double DeformableBody::Impl::elasticEnergy(const Vec& y) const {
  prepareElastic(y);
  if (!elastic.has_energy) elastic.energy = model->energy(y);
  elastic.has_energy = true;
  return elastic.energy;
}

const Vec& DeformableBody::Impl::elasticForces(const Vec& y) const {
  prepareElastic(y);
  if (!elastic.has_forces) model->gradient(y, elastic.forces);
  elastic.has_forces = true;
  return elastic.forces;
}

double DeformableBody::Impl::leastDilatation(const Vec& y) const {
  prepareElastic(y);
  if (!elastic.has_dilatation) elastic.dilatation = model->smallestDilatation(y);
  elastic.has_dilatation = true;
  return elastic.dilatation;
}

// Hexahedra without a matrix give everything at once.
void DeformableBody::Impl::prepareElastic(const Vec& y) const {
  ElasticState& e = elastic;
  if (e.y.size() == y.size() && e.y == y) return;
  if (model->hexes()) return evaluateHexes(y, hex_solver != nullptr, false);
  e.y = y;
  e.has_energy = e.has_forces = e.has_dilatation = false;
}

void DeformableBody::Impl::setViscosity(const Vec& y) {
  viscosity_at = y;
  viscosity_valid = false;
  viscous_velocity.resize(0);
}

const BlockMatrix& DeformableBody::Impl::assembledViscosity() {
  if (viscosity_valid) return viscosity;
  model->viscosity(viscosity_at, viscosity);
  for (double& value : viscosity.values) value *= damping();
  viscosity_valid = true;
  return viscosity;
}

Vec DeformableBody::Impl::applyViscosity(const Vec& w) {
  if (viscous_velocity.size() == w.size() && viscous_velocity == w) return viscous_forces;
  if (model->hexes() && !viscosity_valid) {
    model->hexes()->multiplyMaterial(viscosity_at, w, &elastic_scratch, &viscous_forces);
    viscous_forces *= damping();
  } else {
    assembledViscosity().multiply(w, viscous_forces);
  }
  viscous_velocity = w;
  return viscous_forces;
}

double DeformableBody::Impl::potential(const Vec& y, const Integrator& i, const Vec& loads) {
  double energy = elasticEnergy(y) + softEnergy(y, i) - loads.dot(y);
  if (i.inertia > 0.0) {
    const Vec d = y - i.predicted;
    energy += 0.5 * i.inertia * d.dot(applyMass(d));
    const Vec w = y - i.base;
    if (options.mass_damping > 0.0)
      energy += 0.5 * i.rate * options.mass_damping * w.dot(applyMass(w));
    if (damping() > 0.0) energy += 0.5 * i.rate * w.dot(applyViscosity(w));
  }
  return energy;
}

Vec DeformableBody::Impl::gradient(const Vec& y, const Integrator& i, const Vec& loads) {
  Vec r = elasticForces(y) - loads;
  addSoftGradient(y, i, &r);
  if (i.inertia > 0.0) {
    const Vec w = y - i.base;
    r += applyMass(i.inertia * (y - i.predicted) + i.rate * options.mass_damping * w);
    if (damping() > 0.0) r += i.rate * applyViscosity(w);
  }
  return r;
}

void DeformableBody::Impl::assemble(const Vec& y, const Integrator& i, Definiteness definiteness) {
  model->hessian(y, definiteness, A);
  if (i.inertia > 0.0) {
    const double scale = i.inertia + i.rate * options.mass_damping;
    if (mass) {
      A.combine(1.0, scale, *mass);
    } else {
      const Eigen::VectorXd& m = model->lumpedMass();
      for (int k = 0; k < m.size(); ++k)
        A.block(A.pattern->diagonal[k]).diagonal().array() += scale * m[k];
    }
    if (damping() > 0.0) A.combine(1.0, i.rate, assembledViscosity());
  }
  addSoftHessian(i, &A);
}

// The preconditioner alone has the viscous part at y instead of viscosity_at.
bool DeformableBody::Impl::setMatrixFreeSystem(const Vec& y, const Integrator& i,
                                               Definiteness definiteness) {
  const bool positive = definiteness == Definiteness::kPositive;
  prepareElastic(y);
  if (!elastic.has_stresses || elastic.positive != positive) evaluateHexes(y, true, positive);
  HexSystem system;
  system.positive = positive;
  system.inertia = i.inertia + i.rate * options.mass_damping;
  system.viscosity = i.rate * damping();
  if (system.viscosity > 0.0 && viscosity_at != y) system.viscous_at = viscosity_at;
  for (const SoftTerm& term : soft) {
    SpringBlock spring;
    for (Eigen::SparseVector<double>::InnerIterator it(term.weights); it; ++it)
      spring.weights.emplace_back(static_cast<int>(it.index()), it.value());
    spring.block =
        (term.constraint.stiffness + i.rate * term.constraint.damping) * projector(term.constraint);
    system.springs.push_back(std::move(spring));
  }
  std::vector<int> fixed;
  for (const auto& [dof, unused] : prescribed) fixed.push_back(dof);
  elastic.has_stresses = false;  // the solver takes them
  return hex_solver->setSystem(&elastic.hex, std::move(system), model->lumpedMass(), fixed);
}

bool DeformableBody::Impl::setSystem(const Vec& y, const Integrator& i, Definiteness definiteness,
                                     const Vec* jump, Vec* AJ) {
  leaveSlowMultigrid();
  // Recovery from inversion adds a material that only the assembled system knows.
  matrix_free = hex_solver && !(leastDilatation(y) < kRecoveryDilatation);
  if (matrix_free) {
    const bool positive = setMatrixFreeSystem(y, i, definiteness);
    if (jump) hex_solver->multiply(*jump, AJ);
    return positive;
  }
  assemble(y, i, definiteness);
  if (jump) A.multiply(*jump, *AJ);
  eliminate(prescribed, &A);
  return solver->setMatrix(A, definiteness == Definiteness::kPositive);
}

SolveReport DeformableBody::Impl::solveSystem(const Vec& b, double linear_tolerance,
                                              Vec* direction) {
  if (!matrix_free) return solver->solve(b, linear_tolerance, options.linear_iterations, direction);
  constexpr int kSlow = 20;  // iterations
  const SolveReport report =
      hex_solver->solve(b, linear_tolerance, options.linear_iterations, direction);
  slow_solves = report.iterations > kSlow ? slow_solves + 1 : 0;
  return report;
}

double DeformableBody::Impl::forceScale(const Vec& y, const Integrator& i, const Vec& loads) const {
  const Vec& inner = elasticForces(y);
  Vec outer = loads;
  if (i.inertia > 0.0) outer += applyMass(i.inertia * (i.predicted - y));
  return std::max({inner.norm(), outer.norm(), 1e-12 * loads.norm(), 1e-300});
}

double DeformableBody::Impl::roundOff(const Vec& y) const {
  if (matrix_free) return hex_solver->roundOff(y);
  constexpr double kUnit = 2e-16;
  double sum = 0.0;
  for (Eigen::Index k = 0; k < y.size(); ++k) {
    const Eigen::Index c = k % 3;
    const double diagonal = A.block(A.pattern->diagonal[k / 3])(c, c);
    sum += diagonal * y[k] * diagonal * y[k];
  }
  return kUnit * std::sqrt(sum);
}

void eliminate(const std::map<int, PrescribedDof>& dofs, BlockMatrix* A) {
  const BlockPattern& pattern = *A->pattern;
  for (const auto& [dof, unused] : dofs) {
    const int i = dof / 3, c = dof % 3;
    for (int k = pattern.row_start[i]; k < pattern.row_start[i + 1]; ++k) {
      A->block(k).row(c).setZero();
      A->block(pattern.find(pattern.column[k], i)).col(c).setZero();
    }
  }
  double typical = 0.0;
  for (int k : pattern.diagonal) typical = std::max(typical, A->block(k).diagonal().maxCoeff());
  for (const auto& [dof, unused] : dofs)
    A->block(pattern.diagonal[dof / 3])(dof % 3, dof % 3) = typical > 0.0 ? typical : 1.0;
}

}  // namespace calipso::fem
