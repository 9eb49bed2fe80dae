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

double DeformableBody::Impl::potential(const Vec& y, const Integrator& i, const Vec& loads) const {
  double energy = model->energy(y) + softEnergy(y, i) - loads.dot(y);
  if (i.inertia > 0.0) {
    const Vec d = y - i.predicted;
    energy += 0.5 * i.inertia * d.dot(applyMass(d));
    const Vec w = y - i.base;
    if (options.mass_damping > 0.0)
      energy += 0.5 * i.rate * options.mass_damping * w.dot(applyMass(w));
    if (damping() > 0.0) {
      Vec Dw;
      viscosity.multiply(w, Dw);
      energy += 0.5 * i.rate * w.dot(Dw);
    }
  }
  return energy;
}

Vec DeformableBody::Impl::gradient(const Vec& y, const Integrator& i, const Vec& loads) const {
  Vec r;
  model->gradient(y, r);
  r -= loads;
  addSoftGradient(y, i, &r);
  if (i.inertia > 0.0) {
    const Vec w = y - i.base;
    r += applyMass(i.inertia * (y - i.predicted) + i.rate * options.mass_damping * w);
    if (damping() > 0.0) {
      Vec Dw;
      viscosity.multiply(w, Dw);
      r += i.rate * Dw;
    }
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
    if (damping() > 0.0) A.combine(1.0, i.rate, viscosity);
  }
  addSoftHessian(i, &A);
}

double DeformableBody::Impl::forceScale(const Vec& y, const Integrator& i, const Vec& loads) const {
  Vec inner;
  model->gradient(y, inner);
  Vec outer = loads;
  if (i.inertia > 0.0) outer += applyMass(i.inertia * (i.predicted - y));
  return std::max({inner.norm(), outer.norm(), 1e-12 * loads.norm(), 1e-300});
}

double DeformableBody::Impl::roundOff(const Vec& y) const {
  constexpr double kUnit = 2e-16;
  double sum = 0.0;
  for (int k = 0; k < A.pattern->rows(); ++k)
    sum += A.block(A.pattern->diagonal[k]).diagonal().cwiseProduct(y.segment<3>(3 * k)).squaredNorm();
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
