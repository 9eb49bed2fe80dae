#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "calipso_fem/elastic_model.hpp"
#include "calipso_fem/embedding.hpp"
#include "calipso_fem/fem_options.hpp"
#include "calipso_fem/voxel_grid.hpp"

// A deformable body in motion (paper: sections 4, 7, 8; eqs. 12, 13). World frame, SI units.
//  paper   code             meaning                                       unit
//  M       mass             mass matrix, 3n x 3n                          kg
//  v       velocities()     nodal velocities, 3n                          m/s
//  g       -f_int - D v     internal forces                               N
//  F       external forces  gravity, surface forces, springs, pressure    N
//  h       step(h)          time step                                     s
//  lambda  reaction(node)   multipliers of the fixed components           N
namespace calipso::fem {

// A spring (and damper) from a surface point to a world point; the caller renews the list between
// steps. direction zero: all three components; else only along the unit vector given.
struct SoftConstraint {
  SurfacePoint point;
  Eigen::Vector3d target = Eigen::Vector3d::Zero();           // m
  Eigen::Vector3d target_velocity = Eigen::Vector3d::Zero();  // m/s
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double stiffness = 0.0;  // N/m
  double damping = 0.0;    // N s/m
};

struct StepReport {
  bool converged = false;
  int newton_iterations = 0;
  int linear_iterations = 0;    // CG iterations, all Newton iterations together
  double residual = 0.0;        // |r| / |loads and inner forces|
  double kinetic_energy = 0.0;  // J
  double elastic_energy = 0.0;  // J
  double gravity_energy = 0.0;  // J, zero at the world's origin
  double milliseconds = 0.0;    // wall
  bool recovering = false;      // some element is inverted: the material is stiffened there
  std::string solver;
  std::string message;  // empty unless something has to be said
};

struct Momentum {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   // kg m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  // kg m^2/s about the centre of mass
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   // centre of mass, m
};

using DisplacementOverTime = std::function<double(double time)>;  // s -> m

// Not thread-safe; two bodies may be stepped by two threads.
class DeformableBody {
 public:
  // Rest shape = `surface`, in world coordinates. @throw std::invalid_argument
  DeformableBody(const TriangleMesh& surface, const Material& material, const FemOptions& options);
  // Without a surface: the mesh's nodes are its surface vertices.
  DeformableBody(VolumeMesh mesh, const Material& material, const FemOptions& options);
  ~DeformableBody();
  DeformableBody(DeformableBody&&) noexcept;

  const ElasticModel& model() const;
  const Embedding& embedding() const;
  const VoxelGrid& grid() const;  // without cells when built from a VolumeMesh
  const FemOptions& options() const;
  int nodeCount() const;
  double time() const;  // s, advanced by step()

  // State
  const Vec& positions() const;   // 3n, m
  const Vec& velocities() const;  // 3n, m/s
  void setState(const Vec& positions, const Vec& velocities);
  void setRigidVelocity(const Eigen::Vector3d& linear, const Eigen::Vector3d& angular);
  void applyRigidTransform(const Eigen::Isometry3d& transform);  // to positions and velocities
  void reset();  // rest shape, no velocity, time 0; constraints stay

  // Online change
  void setMaterial(const Material& material);
  void setCellMaterials(const std::vector<Material>& materials);
  void setGravity(const Eigen::Vector3d& gravity);  // m/s^2
  void setRestShape(const TriangleMesh& surface);   // same vertices: the grid is deformed along
  void setRestNodes(const NodeMatrix& nodes);
  void setTolerances(int newton_iterations, double newton_tolerance, double linear_tolerance);

  // Hard constraints (Lagrange multipliers)
  void fixNode(int node);                                     // where it is
  void fixSurfaceVertices(const std::vector<int>& vertices);  // the nodes that carry them
  // Displacement from the rest position, of one component (axis 0..2), as a function of time.
  void prescribe(int node, int axis, DisplacementOverTime displacement);
  void twist(const std::vector<int>& nodes, const Eigen::Vector3d& center,
             const Eigen::Vector3d& axis, std::function<double(double)> angle);  // rad
  void releaseNode(int node);
  void releaseSurfaceVertices(const std::vector<int>& vertices);
  void releaseAll();
  bool isFixed(int node) const;
  bool isPrescribed(int node, int axis) const;
  std::vector<int> nodesOfSurfaceVertices(const std::vector<int>& vertices) const;
  Eigen::Vector3d reaction(int node) const;  // force the constraint puts on the body, N
  Eigen::Vector3d totalReaction() const;

  // Loads; each call replaces the list of before
  void setNodalForces(const Vec& forces);    // 3n, N
  void setSurfaceForces(const Vec& forces);  // 3 #V, N; goes in by J^T
  void setSoftConstraints(std::vector<SoftConstraint> constraints);
  void setPressure(double pressure);  // Pa, on the whole current surface, inwards when > 0
  Eigen::Vector3d softConstraintForce(int index) const;  // on the body, last step, N

  StepReport step(double h);  // h > 0, s. @throw std::invalid_argument
  StepReport solveStatic();   // equilibrium under the present loads; velocities zero

  // One step in parts, so that what depends on where it ends (contact) can be solved along with it:
  // beginStep(), then trialDirection() and moveTrial() until trialResidual() is small, endStep().
  // contact_forces: 3n, N; they act in addition to the loads and may differ from call to call.
  void beginStep(double h);  // h > 0, s; the trial starts at the present positions
  // Before the first direction: the trial goes on as the last two steps did, if that lowers the
  // potential.
  void predictTrial();
  const Vec& trialPositions() const;  // 3n, m
  // Newton direction d of the incremental potential with the forces held: A d = forces - gradient.
  Vec trialDirection(const Vec& contact_forces);
  double trialPotential(const Vec& positions, const Vec& contact_forces) const;
  double trialResidual(const Vec& contact_forces) const;  // over loads and inner forces
  // How far towards `positions` the potential falls: 1, 1/2, 1/4 ...; 0 when it does not.
  double trialStepLength(const Vec& positions, const Vec& contact_forces) const;
  void moveTrial(const Vec& positions);
  StepReport endStep(const Vec& contact_forces);  // the trial becomes the state
  // For who iterates with a system of his own: -gradient without contact, zero where prescribed;
  // ...
  Vec trialDescent();
  // ... A at the trial positions, prescribed components eliminated. `pull` is what the way of these
  // to their targets asks of the others: A d = trialDescent() + pull + forces.
  void trialSystem(Definiteness definiteness, BlockMatrix* A, Vec* pull);
  Vec trialJump() const;  // that way, 3n; zero at all other components

  // Results
  Vec surfaceVertices() const;              // J x, 3 #V, m
  Vec surfaceVelocities() const;            // J v, 3 #V, m/s
  Eigen::VectorXd surfaceVonMises() const;  // #V, Pa
  double elasticEnergy() const;
  double kineticEnergy() const;
  double gravityEnergy() const;
  Momentum momentum() const;
  double totalMass() const;
  bool isAtRest(double speed) const;  // no node is faster than `speed`, m/s

  // Columns w = A^-1 J^T n of the last step's system A = M + h D + h^2 K: the velocity change per
  // unit impulse at a surface point along a direction (Saupin et al. 2008). 3n, m/s per N s.
  Vec complianceColumn(const SurfacePoint& point, const Eigen::Vector3d& direction, double h) const;
  // W_ij = n_i^T J_i A^-1 J_j^T n_j for all pairs of given points and directions.
  Eigen::MatrixXd compliance(const std::vector<SurfacePoint>& points,
                             const std::vector<Eigen::Vector3d>& directions, double h) const;
  // Adds impulses (N s) at surface points to the velocities, through A^-1.
  void applyImpulses(const std::vector<SurfacePoint>& points,
                     const std::vector<Eigen::Vector3d>& impulses, double h);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calipso::fem
