#include <cassert>
#include <cmath>
#include <stdexcept>

#include "body_impl.hpp"

// The step of body_step.cpp taken in parts: whoever drives it chooses forces, directions and step
// lengths, the body gives Newton's direction on the incremental potential and its value.
namespace calipso::fem {

DeformableBody::Impl::Trial& DeformableBody::Impl::runningTrial() {
  assert(trial);
  return *trial;
}

const Vec& DeformableBody::Impl::trialGradient() {
  Trial& t = runningTrial();
  if (t.slope.size() == 0) t.slope = gradient(t.y, t.integrator, t.loads);
  return t.slope;
}

void DeformableBody::beginStep(double h) {
  Impl& m = *impl_;
  if (!(h > 0.0) || !std::isfinite(h))
    throw std::invalid_argument("time step h is " + std::to_string(h) + " s, allowed is > 0");
  Impl::Trial t;
  t.h = h;
  t.loads = m.externalForces();
  t.targets = m.prescribedTargets(m.time + h);
  if (m.damping() > 0.0) m.setViscosity(m.x);
  if (m.options.scheme == TimeScheme::kTrapezoidal && !m.acceleration_known) {
    m.a = m.startAcceleration(t.loads);
    m.acceleration_known = true;
  }
  t.integrator = m.integrator(h);
  t.y = m.x;
  m.trial = std::move(t);
}

void DeformableBody::predictTrial() {
  Impl& m = *impl_;
  Impl::Trial& t = m.runningTrial();
  if (m.options.linearised) return;
  for (const auto& [dof, p] : m.prescribed)
    if (t.targets[dof] != t.y[dof]) return;
  if (m.moveAhead(t.integrator, t.loads, &t.y)) t.slope.resize(0);
}

const Vec& DeformableBody::trialPositions() const { return impl_->runningTrial().y; }

Vec DeformableBody::trialDirection(const Vec& contact_forces) {
  Impl& m = *impl_;
  Impl::Trial& t = m.runningTrial();
  Vec direction;
  const Vec residual = m.trialGradient() - contact_forces, jump = trialJump();
  Vec masked = residual;
  m.maskResidual(&masked);
  const double wanted =
      m.options.newton_tolerance * m.forceScale(t.y, t.integrator, t.loads + contact_forces);
  const double tolerance = jump.isZero(0.0) ? m.forcing(t.report.newton_iterations, masked.norm(),
                                                        t.residual_before, wanted)
                                            : m.options.linear_tolerance;
  t.residual_before = masked.norm();
  ++t.report.newton_iterations;
  if (m.newtonDirection(t.y, t.integrator, residual, jump, tolerance, &t.report, &direction))
    return direction;
  t.report.message =
      "no positive definite system: the body is free to move without resistance, "
      "or its state is not finite";
  return Vec::Zero(t.y.size());
}

double DeformableBody::trialPotential(const Vec& positions, const Vec& contact_forces) const {
  const Impl::Trial& t = impl_->runningTrial();
  return impl_->potential(positions, t.integrator, t.loads + contact_forces);
}

double DeformableBody::trialResidual(const Vec& contact_forces) const {
  Impl& m = *impl_;
  const Impl::Trial& t = m.runningTrial();
  Vec residual = m.trialGradient() - contact_forces;
  m.maskResidual(&residual);
  if (m.system_valid && residual.norm() <= m.roundOff(t.y)) return 0.0;
  return residual.norm() / m.forceScale(t.y, t.integrator, t.loads + contact_forces);
}

double DeformableBody::trialStepLength(const Vec& positions, const Vec& contact_forces) const {
  constexpr double kSmallestStep = 1.0 / 4096.0;
  const Impl::Trial& t = impl_->runningTrial();
  // Where a prescribed boundary moves, the potential may rise.
  for (const auto& [dof, p] : impl_->prescribed)
    if (t.targets[dof] != t.y[dof]) return 1.0;
  const double here = trialPotential(t.y, contact_forces);
  const double noise = 1e-13 * std::abs(here);
  for (double s = 1.0; s >= kSmallestStep; s *= 0.5)
    if (trialPotential(t.y + s * (positions - t.y), contact_forces) <= here + noise) return s;
  return 0.0;
}

void DeformableBody::moveTrial(const Vec& positions) {
  Impl::Trial& t = impl_->runningTrial();
  t.y = positions;
  t.slope.resize(0);
}

Vec DeformableBody::trialDescent() {
  Vec descent = -impl_->trialGradient();
  impl_->maskResidual(&descent);
  return descent;
}

Vec DeformableBody::trialJump() const {
  const Impl::Trial& t = impl_->runningTrial();
  Vec jump = Vec::Zero(t.y.size());
  for (const auto& [dof, p] : impl_->prescribed) jump[dof] = t.targets[dof] - t.y[dof];
  return jump;
}

// NOTE: the viscous part has the tangent at the trial positions instead of the step's start: good
// enough to iterate with, and half the work.
void DeformableBody::trialSystem(Definiteness definiteness, BlockMatrix* A, Vec* pull) {
  Impl& m = *impl_;
  const Impl::Trial& t = m.runningTrial();
  const Integrator& i = t.integrator;
  m.model->hessian(t.y, definiteness, *A);
  for (double& value : A->values) value *= 1.0 + i.rate * m.damping();
  const double inertia = i.inertia + i.rate * m.options.mass_damping;
  if (m.mass) {
    A->combine(1.0, inertia, *m.mass);
  } else {
    const Eigen::VectorXd& mass = m.model->lumpedMass();
    for (int k = 0; k < mass.size(); ++k)
      A->block(A->pattern->diagonal[k]).diagonal().array() += inertia * mass[k];
  }
  m.addSoftHessian(i, A);
  const Vec jump = trialJump();
  if (jump.isZero(0.0)) {
    pull->setZero(t.y.size());
  } else {
    A->multiply(jump, *pull);
    *pull = -*pull;
    m.maskResidual(pull);
  }
  eliminate(m.prescribed, A);
}

StepReport DeformableBody::endStep(const Vec& contact_forces) {
  Impl& m = *impl_;
  Impl::Trial& t = m.runningTrial();
  StepReport report = t.report;
  report.converged = t.y.allFinite() && report.message.empty();
  if (t.y.allFinite()) {
    const Integrator& i = t.integrator;
    const Vec v1 = i.rate * (t.y - i.base);
    if (m.options.scheme == TimeScheme::kTrapezoidal) m.a = 2.0 / t.h * (v1 - m.v) - m.a;
    m.previous = std::make_pair(m.x, m.v);
    m.previous_h = t.h;
    const bool turns_freely = m.turnsFreely();
    const Momentum before = turns_freely ? m.momentum() : Momentum();
    m.reactions.setZero(m.x.size());
    if (!m.prescribed.empty()) {
      const Vec r = m.trialGradient() - contact_forces;
      for (const auto& [dof, p] : m.prescribed) m.reactions[dof] = r[dof];
    }
    m.x = t.y;
    m.v = v1;
    m.rememberSoftForces(i);
    if (turns_freely) m.keepAngularMomentum(before, t.loads + contact_forces, t.h);
  } else {
    report.message = "the step gave positions that are not finite; the state before it is kept";
  }
  m.time += t.h;
  m.finishReport(&report);
  m.trial.reset();
  return report;
}

}  // namespace calipso::fem
