#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "calipso_fem/deformable_body.hpp"
#include "calipso_fem/world/surface_tree.hpp"

namespace calipso::fem {

// A contact that holds the object in its observed shape.
struct HoldPoint {
  int vertex = 0;
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  // out: on the object, N
};

struct SettleReport {
  double sag = 0.0;    // largest displacement under gravity if the shape were the rest shape, m
  int iterations = 0;  // of the rest shape; 0: the sag is below the tolerance
  bool converged = false;
  std::string message;  // empty unless something has to be said
};

// A deformable object in the simulated world: the FEM body and what the world needs around it:
// loads added up from several sources, its rigid motion, the surface for contacts, cached
// compliances.
class SoftObject {
 public:
  // surface: world frame, as observed.
  SoftObject(const TriangleMesh& surface, const Material& material, const FemOptions& options);

  DeformableBody& body() { return body_; }
  const DeformableBody& body() const { return body_; }

  // Makes the present shape the equilibrium under `gravity`, the hard constraints and the given
  // points of contact: the rest shape X is corrected by X -= x(X) - x_observed until the sag of the
  // remainder is below `tolerance` (m).
  SettleReport settle(const Eigen::Vector3d& gravity, std::vector<HoldPoint>& hold,
                      double tolerance);

  // One step under gravity and all forces given since the last one. Without constraints and forces
  // the flight is exact: the centre of mass follows its parabola, angular momentum is kept.
  StepReport step(double h);

  void setGravity(const Eigen::Vector3d& gravity);
  void addForce(const SurfacePoint& point, const Eigen::Vector3d& force);  // N, for the next step

  // Impulses (N s) that act over the step just made: velocities change by A^-1 J^T p, positions by
  // h times that.
  void applyImpulses(const std::vector<SurfacePoint>& points,
                     const std::vector<Eigen::Vector3d>& impulses, double h);

  // Approximate change of the velocity at `at` per impulse at `from`, from cached columns of A^-1
  // turned with the body (Saupin et al. 2008). m/s per N s.
  Eigen::Matrix3d compliance(const SurfacePoint& at, const SurfacePoint& from, double h);
  void forgetCompliance() { columns_.clear(); }

  // The node with the largest weight at a surface vertex: contacts are thinned to one per such
  // node.
  int carrier(int vertex) const { return carrier_[vertex]; }
  Eigen::Vector3d position(const SurfacePoint& point) const;
  Eigen::Vector3d velocity(const SurfacePoint& point) const;
  const decltype(TriangleMesh::vertices)& vertices() const { return vertices_; }
  const decltype(TriangleMesh::vertices)& previousVertices() const { return previous_; }
  const SurfaceTree& tree();

  // Rigid motion that best maps the observed shape to the present one (Kabsch, by nodal mass).
  Eigen::Isometry3d motion() const;
  bool hasFixedNodes() const;
  void changed();     // the state was set from outside
  void standStill();  // it did not get here by moving: nothing lies on its way

 private:
  struct Column {
    NodeMatrix c[3];           // #N x 3 each: answer to a unit impulse along x, y, z
    Eigen::Matrix3d rotation;  // of the body when it was computed
  };

  const Column& columnOf(int vertex, double h);
  void keepFlightExact(const Momentum& before, double h);
  void restoreAngularMomentum(const Eigen::Vector3d& target);
  Eigen::Vector3d gather(const Vec& nodal, const SurfacePoint& point) const;

  DeformableBody body_;
  Eigen::Vector3d gravity_ = Eigen::Vector3d::Zero();
  Vec forces_;  // 3 #V, for the next step
  bool forced_ = false;
  Vec observed_;  // 3 #N, nodes at construction
  std::vector<int> carrier_;
  decltype(TriangleMesh::vertices) vertices_, previous_;
  std::unique_ptr<SurfaceTree> tree_;
  bool tree_stale_ = true;
  TriangleMesh surface_;
  std::map<int, Column> columns_;  // by carrier node
  double column_step_ = 0.0;
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();  // of motion(), renewed by changed()
};

}  // namespace calipso::fem
