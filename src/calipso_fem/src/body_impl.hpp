#pragma once

#include <map>
#include <optional>

#include "calipso_fem/deformable_body.hpp"
#include "element.hpp"
#include "hex_solver.hpp"
#include "linear_solver.hpp"

namespace calipso::fem {

// x(t) = prescribed displacement of one component, from its rest position.
struct PrescribedDof {
  DisplacementOverTime displacement;  // m
};

// v1 = rate (x1 - base); inertia acts as inertia M (x1 - predicted).
struct Integrator {
  double inertia = 0.0;  // 1/s^2
  double rate = 0.0;     // 1/s
  Vec predicted, base;   // m
};

struct SoftTerm {
  SoftConstraint constraint;
  Eigen::SparseVector<double> weights;  // on the nodes
};

// The elastic energy and its gradient at y, each when first asked for.
struct ElasticState {
  Vec y;
  bool has_energy = false, has_forces = false, has_dilatation = false;
  bool has_stresses = false, positive = false;  // in `hex`, for the system at y
  double energy = 0.0, dilatation = 0.0;
  Vec forces;
  HexEvaluation hex;
};

struct DeformableBody::Impl {
  FemOptions options;
  VoxelGrid grid;
  Embedding embedding;
  CellMatrix surface_triangles;  // #F x 3
  std::unique_ptr<ElasticModel> model;
  std::unique_ptr<LinearSolver> solver;
  std::unique_ptr<HexSolver> hex_solver;  // without a matrix; null where not possible or not wanted

  // State
  Vec x, v, a;                                  // m, m/s, m/s^2 (trapezoidal)
  std::optional<std::pair<Vec, Vec>> previous;  // x, v of the step before (BDF2)
  double previous_h = 0.0;
  bool acceleration_known = false;
  double time = 0.0;

  // Loads and constraints
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  Vec nodal_forces, surface_forces;  // empty: none
  double pressure = 0.0;
  std::vector<SoftTerm> soft;
  std::map<int, PrescribedDof> prescribed;  // by dof
  Vec reactions;                            // 3n, N
  Vec soft_forces;                          // 3 per soft constraint, N

  // Work space of the current step
  std::optional<BlockMatrix> mass;  // consistent only
  mutable ElasticState elastic;
  HexEvaluation elastic_scratch;
  BlockMatrix A;
  Vec viscosity_at;  // damping acts as D(viscosity_at) v
  BlockMatrix viscosity;
  bool viscosity_valid = false;          // viscosity is D(viscosity_at)
  Vec viscous_velocity, viscous_forces;  // of the last applyViscosity(); empty: none
  bool system_valid = false;             // the solver holds the last step's system
  bool matrix_free = false;              // ... and it is hex_solver
  int slow_solves = 0;                   // by hex_solver, one after the other

  // A step taken in parts (body_stepwise.cpp)
  struct Trial {
    double h = 0.0;
    Integrator integrator;
    Vec loads, targets, y;
    Vec slope;                     // gradient at y without contact; empty when y has moved since
    double residual_before = 0.0;  // norm at the last direction
    StepReport report;
  };
  std::optional<Trial> trial;
  Trial& runningTrial();
  const Vec& trialGradient();

  void initialise(const Material& material);
  void chooseSolver();
  void leaveSlowMultigrid();
  double damping() const { return model->cellMaterials().front().damping; }

  // y = M x for a 3n vector
  Vec applyMass(const Vec& y) const;
  Vec externalForces() const;  // gravity, nodal, surface, pressure; at the present state
  Vec pressureForces() const;

  // Of the elastic energy at y; what is asked for again is not computed again.
  double elasticEnergy(const Vec& y) const;
  const Vec& elasticForces(const Vec& y) const;
  double leastDilatation(const Vec& y) const;
  void prepareElastic(const Vec& y) const;
  void evaluateHexes(const Vec& y, bool stresses, bool positive) const;
  void setViscosity(const Vec& y);
  Vec applyViscosity(const Vec& w);  // D w, damping included
  const BlockMatrix& assembledViscosity();

  Vec prescribedTargets(double t) const;  // 3n; meaningful at prescribed dofs
  void maskResidual(Vec* r) const;

  // Springs: energy, force (gradient), stiffness, at positions y with velocities rate (y - base).
  double softEnergy(const Vec& y, const Integrator& i) const;
  void addSoftGradient(const Vec& y, const Integrator& i, Vec* r) const;
  void addSoftHessian(const Integrator& i, BlockMatrix* K) const;
  void rememberSoftForces(const Integrator& i);

  Integrator integrator(double h) const;
  // Incremental potential, its gradient and Hessian (the matrix A).
  double potential(const Vec& y, const Integrator& i, const Vec& loads);
  Vec gradient(const Vec& y, const Integrator& i, const Vec& loads);
  void assemble(const Vec& y, const Integrator& i, Definiteness definiteness);  // all dofs
  // The system at y, solved without a matrix where that is possible. AJ: A jump, when jump is
  // given. False: not positive definite.
  bool setSystem(const Vec& y, const Integrator& i, Definiteness definiteness, const Vec* jump,
                 Vec* AJ);
  bool setMatrixFreeSystem(const Vec& y, const Integrator& i, Definiteness definiteness);
  SolveReport solveSystem(const Vec& b, double linear_tolerance, Vec* direction);
  // Size of the terms that have to balance, N.
  double forceScale(const Vec& y, const Integrator& i, const Vec& loads) const;
  // Residual that rounding of positions and inner forces alone leaves, N. @pre the system is set
  double roundOff(const Vec& y) const;

  StepReport minimise(const Integrator& i, const Vec& loads, const Vec& targets, bool linearised,
                      Vec* y);
  Vec expectedMove(const Integrator& i) const;
  // From the present positions to where the last two steps' motion leads, if the potential is lower
  // there.
  bool moveAhead(const Integrator& i, const Vec& loads, Vec* y);
  // Relative residual to which Newton's direction number `iteration` (from 0) is worth solving for.
  // residual_before: norm at the last one; 0 at the first. wanted: norm to end with
  double forcing(int iteration, double residual, double residual_before, double wanted) const;
  // One Newton direction; false when no positive definite system could be solved.
  bool newtonDirection(const Vec& y, const Integrator& i, const Vec& residual, const Vec& jump,
                       double linear_tolerance, StepReport* report, Vec* direction);
  double searchLine(const Vec& y, const Vec& direction, const Vec& residual, const Integrator& i,
                    const Vec& loads, double energy);
  // M^-1 (F - f_int - D v) of the free components: what the trapezoidal rule starts from.
  Vec startAcceleration(const Vec& loads);
  void finishReport(StepReport* report) const;
  void invalidatePreconditioner();
  Momentum momentum() const;
  bool turnsFreely() const {
    return options.scheme == TimeScheme::kBackwardEuler && prescribed.empty();
  }
  void keepAngularMomentum(const Momentum& before, const Vec& loads, double h);
  void invalidateSystem();
  void modelChanged();  // material or rest shape
  // A^-1 of the last step's system times impulses on the nodes (N s): change of velocity, m/s.
  Vec velocityChange(Vec impulses, double h);
  Vec nodalImpulse(const SurfacePoint& point, const Eigen::Vector3d& impulse) const;
};

// Rows and columns of the given dofs become those of the identity matrix times a typical diagonal.
void eliminate(const std::map<int, PrescribedDof>& dofs, BlockMatrix* A);

}  // namespace calipso::fem
