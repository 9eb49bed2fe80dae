#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "body_impl.hpp"

// Time steps and equilibria: damped Newton on the incremental potential of body_system.cpp.
namespace calipso::fem {
namespace {

double millisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

// Largest relative residual of a Newton direction.
constexpr double kLoosestForcing = 0.05;
// Of the residual with which a step may end: what the last direction is solved to.
constexpr double kSpare = 0.1;

}  // namespace

Integrator DeformableBody::Impl::integrator(double h) const {
  Integrator i;
  const bool has_previous = previous && previous_h == h;
  if (options.scheme == TimeScheme::kTrapezoidal) {
    i.rate = 2.0 / h;
    i.inertia = 4.0 / (h * h);
    i.base = x + 0.5 * h * v;
    i.predicted = x + h * v + 0.25 * h * h * a;
  } else if (options.scheme == TimeScheme::kBdf2 && has_previous) {
    i.rate = 1.5 / h;
    i.inertia = i.rate * i.rate;
    i.base = (4.0 * x - previous->first) / 3.0;
    i.predicted = i.base + (4.0 * v - previous->second) / (3.0 * i.rate);
  } else {
    i.rate = 1.0 / h;
    i.inertia = i.rate * i.rate;
    i.base = x;
    i.predicted = x + h * v;
  }
  return i;
}

// Displacement of the free components in this step if their acceleration stays.
Vec DeformableBody::Impl::expectedMove(const Integrator& i) const {
  if (!(i.inertia > 0.0)) return Vec::Zero(x.size());
  const Vec next = previous ? Vec(2.0 * v - previous->second) : v;
  Vec move = i.base + next / i.rate - x;
  maskResidual(&move);
  return move;
}

bool DeformableBody::Impl::moveAhead(const Integrator& i, const Vec& loads, Vec* y) {
  if (!(i.inertia > 0.0)) return false;
  const Vec ahead = *y + expectedMove(i);
  if (!(potential(ahead, i, loads) < potential(*y, i, loads))) return false;
  *y = ahead;
  return true;
}

bool DeformableBody::Impl::newtonDirection(const Vec& y, const Integrator& i, const Vec& residual,
                                           const Vec& jump, double linear_tolerance,
                                           StepReport* report, Vec* direction) {
  const bool jumps = !jump.isZero(0.0);
  for (const Definiteness definiteness : {Definiteness::kExact, Definiteness::kPositive}) {
    Vec b = -residual, AJ;
    if (!setSystem(y, i, definiteness, jumps ? &jump : nullptr, &AJ)) continue;
    // Prescribed components move by `jump`; what that does to the others goes to the right side.
    if (jumps) b -= AJ;
    maskResidual(&b);
    *direction = y == x ? expectedMove(i) : Vec(Vec::Zero(y.size()));
    const SolveReport solve = solveSystem(b, linear_tolerance, direction);
    report->linear_iterations += solve.iterations;
    if (!solve.positive) continue;
    *direction += jump;
    system_valid = direction->allFinite();
    if (system_valid) return true;
  }
  invalidateSystem();
  return false;
}

// Forcing terms (Eisenstat and Walker 1996, choice 2): no direction is solved for better than it is
// worth. Steps that take long get ones that could end them: near-incompressible bodies would run
// out of iterations.
double DeformableBody::Impl::forcing(int iteration, double residual, double residual_before,
                                     double wanted) const {
  const double ratio = residual_before > 0.0 ? residual / residual_before : 1.0;
  const double worth = iteration < 2 ? 0.9 * ratio * ratio : 0.0;
  const double enough = std::max(options.linear_tolerance, kSpare * wanted / residual);
  return std::min(kLoosestForcing, std::max(enough, worth));
}

double DeformableBody::Impl::searchLine(const Vec& y, const Vec& direction, const Vec& residual,
                                        const Integrator& i, const Vec& loads, double energy) {
  constexpr double kSufficientDecrease = 1e-4;
  constexpr double kSmallestStep = 1e-8;
  const double slope = residual.dot(direction);
  const double noise = 1e-13 * std::abs(energy);
  for (double t = 1.0; t > kSmallestStep; t *= 0.5) {
    const double reached = potential(y + t * direction, i, loads);
    if (reached <= energy + kSufficientDecrease * t * slope + noise) return t;
  }
  return 0.0;
}

StepReport DeformableBody::Impl::minimise(const Integrator& i, const Vec& loads, const Vec& targets,
                                          bool linearised, Vec* y) {
  StepReport report;
  Vec jump = targets - *y;
  if (!linearised && jump.isZero(0.0)) moveAhead(i, loads, y);
  Vec r = gradient(*y, i, loads);
  Vec direction;
  double residual_before = 0.0;
  const int most = linearised ? 1 : options.newton_iterations;
  for (; report.newton_iterations < most; ++report.newton_iterations) {
    Vec masked = r;
    maskResidual(&masked);
    const double scale = forceScale(*y, i, loads);
    report.residual = masked.norm() / scale;
    if (!linearised && jump.isZero(0.0) && report.residual <= options.newton_tolerance) break;
    const double linear_tolerance =
        linearised || !jump.isZero(0.0)
            ? options.linear_tolerance
            : forcing(report.newton_iterations, masked.norm(), residual_before,
                      options.newton_tolerance * scale);
    residual_before = masked.norm();
    if (!newtonDirection(*y, i, r, jump, linear_tolerance, &report, &direction)) {
      report.message =
          "no positive definite system: the body is free to move without resistance, "
          "or its state is not finite";
      return report;
    }
    const double noise = roundOff(*y);
    if (!linearised && jump.isZero(0.0) && masked.norm() <= noise) {
      report.converged = true;
      break;
    }
    const bool moved_boundary = !jump.isZero(0.0);
    double t = 1.0;
    if (!linearised && !moved_boundary)
      t = searchLine(*y, direction, masked, i, loads, potential(*y, i, loads));
    if (t == 0.0) break;
    *y += t * direction;
    jump.setZero();
    r = gradient(*y, i, loads);
  }
  Vec masked = r;
  maskResidual(&masked);
  report.residual = masked.norm() / forceScale(*y, i, loads);
  report.converged = report.converged || linearised || report.residual <= options.newton_tolerance;
  reactions.setZero(x.size());
  for (const auto& [dof, p] : prescribed) reactions[dof] = r[dof];
  return report;
}

void DeformableBody::Impl::finishReport(StepReport* report) const {
  report->kinetic_energy = 0.5 * v.dot(applyMass(v));
  report->elastic_energy = elasticEnergy(x);
  const Eigen::VectorXd& m = model->lumpedMass();
  for (int k = 0; k < m.size(); ++k)
    report->gravity_energy -= m[k] * gravity.dot(x.segment<3>(3 * k));
  report->solver = toString(matrix_free ? SolverKind::kMultigrid : solver->kind());
  report->recovering = model->model() == MaterialModel::kStVenantKirchhoff &&
                       leastDilatation(x) < kRecoveryDilatation;
}

Vec DeformableBody::Impl::startAcceleration(const Vec& loads) {
  Integrator here;
  here.base = here.predicted = x;
  Vec b = -gradient(x, here, loads);
  if (options.mass_damping > 0.0) b -= options.mass_damping * applyMass(v);
  if (damping() > 0.0) b -= applyViscosity(v);
  maskResidual(&b);
  if (!mass) {
    for (Eigen::Index k = 0; k < b.size(); ++k) b[k] /= model->lumpedMass()[k / 3];
    return b;
  }
  BlockMatrix M = *mass;
  eliminate(prescribed, &M);
  const auto jacobi = makeJacobi();
  jacobi->update(M);
  Vec result = Vec::Zero(b.size());
  constexpr double kTolerance = 1e-13;
  conjugateGradients(M, *jacobi, b, kTolerance, 1000, &result);
  return result;
}

// NOTE: backward Euler slows the turning of a free body by (omega h)^2 in every step. Its change of
// angular momentum is set to what the external forces give it. (y - x) / h is the velocity in the
// middle of the step, along the chord: it is turned by half the step's rotation; then a rigid
// rotation about the centre of mass is added.
void DeformableBody::Impl::keepAngularMomentum(const Momentum& before, const Vec& loads, double h) {
  Momentum now = momentum();
  Vec force = -loads;
  Integrator i;
  i.rate = 1.0 / h;
  i.base = x - h * v;
  addSoftGradient(x, i, &force);
  const auto momentOf = [&](const Vec& f) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (Eigen::Index k = 0; k < x.size(); k += 3)
      sum += Eigen::Vector3d(x.segment<3>(k) - now.center).cross(Eigen::Vector3d(f.segment<3>(k)));
    return sum;
  };
  const Eigen::Vector3d target =
      (before.angular - h * momentOf(force)) / (1.0 + h * options.mass_damping);
  Vec spin[3];
  Eigen::Matrix3d inertia;
  for (int axis = 0; axis < 3; ++axis) {
    spin[axis].resize(x.size());
    for (Eigen::Index k = 0; k < x.size(); k += 3)
      spin[axis].segment<3>(k) =
          Eigen::Vector3d::Unit(axis).cross(Eigen::Vector3d(x.segment<3>(k) - now.center));
    inertia.col(axis) = momentOf(applyMass(spin[axis]));
  }
  const auto factor = inertia.ldlt();
  const Eigen::Vector3d half = 0.5 * h * factor.solve(target);
  if (!half.allFinite()) return;
  const Eigen::Vector3d drift = now.linear / model->totalMass();
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(half.norm(), half.stableNormalized()).toRotationMatrix();
  for (Eigen::Index k = 0; k < v.size(); k += 3)
    v.segment<3>(k) = drift + R * (Eigen::Vector3d(v.segment<3>(k)) - drift);
  now = momentum();
  const Eigen::Vector3d turn = factor.solve(target - now.angular);
  for (int axis = 0; axis < 3; ++axis) v += turn[axis] * spin[axis];
}

StepReport DeformableBody::step(double h) {
  Impl& m = *impl_;
  if (!(h > 0.0) || !std::isfinite(h))
    throw std::invalid_argument("time step h is " + std::to_string(h) + " s, allowed is > 0");
  const auto start = std::chrono::steady_clock::now();
  const Vec loads = m.externalForces();
  const Vec targets = m.prescribedTargets(m.time + h);
  if (m.damping() > 0.0) m.setViscosity(m.x);
  if (m.options.scheme == TimeScheme::kTrapezoidal && !m.acceleration_known) {
    m.a = m.startAcceleration(loads);
    m.acceleration_known = true;
  }
  const Integrator i = m.integrator(h);
  const bool turns_freely = m.turnsFreely();
  const Momentum before = turns_freely ? m.momentum() : Momentum();
  Vec y = m.x;
  StepReport report = m.minimise(i, loads, targets, m.options.linearised, &y);
  if (y.allFinite()) {
    const Vec v1 = i.rate * (y - i.base);
    if (m.options.scheme == TimeScheme::kTrapezoidal) m.a = 2.0 / h * (v1 - m.v) - m.a;
    m.previous = std::make_pair(m.x, m.v);
    m.previous_h = h;
    m.x = y;
    m.v = v1;
    m.rememberSoftForces(i);
    if (turns_freely) m.keepAngularMomentum(before, loads, h);
  } else {
    report.converged = false;
    report.message = "the step gave positions that are not finite; the state before it is kept";
  }
  m.time += h;
  m.finishReport(&report);
  report.milliseconds = millisecondsSince(start);
  return report;
}

StepReport DeformableBody::solveStatic() {
  Impl& m = *impl_;
  const auto start = std::chrono::steady_clock::now();
  Integrator rest;
  rest.base = rest.predicted = m.x;
  const Vec from = m.x, loads = m.externalForces(), targets = m.prescribedTargets(m.time);
  StepReport report;
  // Load stepping: all loads and prescribed displacements grow together.
  for (int steps = m.options.static_load_steps; steps <= m.options.static_most_load_steps;
       steps *= 2) {
    Vec y = from;
    StepReport attempt;
    for (int k = 1; k <= steps; ++k) {
      const double s = static_cast<double>(k) / steps;
      const StepReport part = m.minimise(rest, s * loads, from + s * (targets - from), false, &y);
      attempt.converged = part.converged;
      attempt.residual = part.residual;
      attempt.message = part.message;
      attempt.newton_iterations += part.newton_iterations;
      attempt.linear_iterations += part.linear_iterations;
      if (!part.converged) break;
    }
    const bool better = attempt.converged || steps == m.options.static_load_steps;
    if (better && y.allFinite()) m.x = y;
    report = attempt;
    if (attempt.converged) break;
  }
  m.v.setZero();
  m.acceleration_known = false;
  m.previous.reset();
  m.rememberSoftForces(rest);
  m.system_valid = false;
  m.finishReport(&report);
  report.milliseconds = millisecondsSince(start);
  return report;
}

}  // namespace calipso::fem
