#pragma once

#include <Eigen/Geometry>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
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
  double sag = 0.0;        // largest displacement under gravity if the shape were the rest shape, m
  int iterations = 0;      // of the rest shape; 0: the sag is below the tolerance
  bool converged = false;  // false: a prestress carries the weight
  std::string message;     // empty unless something has to be said
};

class SelfProximity;
class SoftSystem;

// A deformable object in the simulated world: the FEM body and what the world needs around it:
// loads added up from several sources, its rigid motion, the surface for contacts, the system
// contacts are solved with.
class SoftObject {
 public:
  // surface: world frame, as observed.
  SoftObject(const TriangleMesh& surface, const Material& material, const FemOptions& options);
  ~SoftObject();

  DeformableBody& body() { return body_; }
  const DeformableBody& body() const { return body_; }

  // Makes the present shape the equilibrium under `gravity`, the hard constraints and the given
  // points of contact: the rest shape X is corrected by X -= x(X) - x_observed until the sag of the
  // remainder is below `tolerance` (m). Where there is no such X, the body is relaxed as observed,
  // and a prestress (prestress.hpp) of the present material carries its weight.
  SettleReport settle(const Eigen::Vector3d& gravity, std::vector<HoldPoint>& hold,
                      double tolerance);
  // Largest way (m) that it would sag by linear elasticity, were it relaxed in its present shape
  // and held by its fixed nodes and the points; nothing where it would tip over on these.
  std::optional<double> linearSag(const Eigen::Vector3d& gravity,
                                  const std::vector<HoldPoint>& hold) const;
  void setMaterial(const Material& material);
  // The prestress of another body with the same nodes.
  void copyPrestress(const SoftObject& other);

  StepReport step(double h);  // under gravity and what drives it alone, without contacts
  // One step under gravity, all forces given and contacts: whoever solves for these drives the
  // body's trial in between. `gained`: impulse and, about the centre of mass before the step, its
  // moment, of a body that nothing else holds; then momentum is exact, and flight follows its
  // parabola.
  void beginStep(double h);
  StepReport endStep(const Vec& contact_forces, double h, const std::optional<Momentum>& gained);
  const Momentum& momentumBefore() const { return before_; }

  void setGravity(const Eigen::Vector3d& gravity);
  void addForce(const SurfacePoint& point, const Eigen::Vector3d& force);  // N, until cleared
  void clearForces();
  void setDrive(const Vec& forces) { drive_ = forces; }  // 3n, N, until others are given

  // The system that contact iterates with; forgotten when the body's own has changed for good.
  SoftSystem& system() { return *system_; }
  void forgetSystem();
  const Eigen::Matrix3d& rotation() const { return rotation_; }  // of motion()

  // The node with the largest weight at a surface vertex: contacts are thinned to one per such
  // node.
  int carrier(int vertex) const { return carrier_[vertex]; }
  Eigen::Vector3d position(const SurfacePoint& point) const;
  Eigen::Vector3d velocity(const SurfacePoint& point) const;
  const decltype(TriangleMesh::vertices)& vertices() const { return vertices_; }
  double fastest() const { return fastest_; }  // surface vertex, m/s
  const Eigen::Vector3d& gravity() const { return gravity_; }
  const SurfaceTree& tree();
  // Whether the surface meets itself. @throw std::invalid_argument unless it is closed and faces
  // outwards
  void setSelfContact(bool on);
  SelfProximity* selfProximity() { return self_.get(); }  // of one that does

  // A field on the surface (3 #V) as the nodes move that carry it: each goes as its surface does on
  // average. Zero at nodes that are fixed or carry none.
  Vec nodalField(const Vec& surface) const;

  // Rigid motion that best maps the observed shape to the present one (Kabsch, by nodal mass).
  Eigen::Isometry3d motion() const;
  bool hasFixedNodes() const;
  bool isHeld(const SurfacePoint& point) const;  // by fixed nodes alone
  void changed();                                // the state was set from outside

 private:
  double holdStiffness(size_t points) const;  // N/m, of each
  SettleReport findRestShape(const Vec& goal, double stiffness, std::vector<HoldPoint>& hold,
                             double tolerance);
  void applyNodalForces();
  void setMomentum(const Momentum& target);
  Eigen::Vector3d gather(const Vec& nodal, const SurfacePoint& point) const;

  DeformableBody body_;
  Eigen::Vector3d gravity_ = Eigen::Vector3d::Zero();
  Vec forces_;  // 3 #V, N
  bool forced_ = false;
  Vec observed_;                    // 3 #N, nodes at construction
  Vec prestress_;                   // 3 #N, N, at the observed shape; empty: none
  Vec drive_;                       // 3 #N, N; empty: never one
  double prestress_modulus_ = 0.0;  // Pa, of the material with which it carries the weight
  std::vector<int> carrier_;
  decltype(TriangleMesh::vertices) vertices_;
  double fastest_ = 0.0;
  Momentum before_;
  std::unique_ptr<SurfaceTree> tree_;
  bool tree_stale_ = true;
  TriangleMesh surface_;
  std::unique_ptr<SoftSystem> system_;
  std::unique_ptr<SelfProximity> self_;
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();  // of motion(), renewed by changed()
};

}  // namespace calipso::fem
