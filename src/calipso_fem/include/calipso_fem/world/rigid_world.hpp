#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "calipso_fem/world/mass_properties.hpp"
#include "calipso_fem/world/world_types.hpp"

namespace calipso::fem {

enum class RigidMotion { kStatic, kKinematic, kDynamic };

// A body to be put into the rigid world.
struct RigidBodySpec {
  std::string name;
  std::vector<TriangleMesh> shapes;  // object frame; convex, or one arbitrary surface if static
  MassProperties mass;               // object frame; ignored unless dynamic
  RigidMotion motion = RigidMotion::kDynamic;
  SurfaceSettings surface;
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   // of the centre of mass, m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  // rad/s
  bool asleep = false;
};

// A point where a dynamic rigid body rests on, or is about to touch, something rigid.
struct RigidTouch {
  std::optional<int> a, b;  // dynamic bodies; empty: it stands
  Eigen::Vector3d place = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();  // b to a
  double gap = 0.0;                                                                    // m
  double friction = 0.0;
};

// Rigid bodies and supports in Bullet (double precision). World frame, SI units. Gravity is given
// per body, so that each may have its own. Where two bodies overlap when one is added, the overlap
// is forgiven: it may only become smaller, and gives no push. Deterministic; not thread-safe.
class RigidWorld {
 public:
  using Id = int;

  RigidWorld();
  ~RigidWorld();

  // @throw std::invalid_argument naming the body and what is wrong (shapes, mass, friction)
  Id add(const RigidBodySpec& spec);
  Id addPlane(const SupportPlane& plane, const SurfaceSettings& surface);
  void remove(Id id);  // wakes nothing that sleeps on it; no more does setPose()

  // Contact between the two, whatever they are: none, or with a friction or restitution of its own.
  void setRule(Id a, Id b, const PairRule& rule);
  void setSurface(Id id, const SurfaceSettings& surface);

  void setPose(Id id, const Eigen::Isometry3d& world_from_object);        // a jump
  void moveKinematic(Id id, const Eigen::Isometry3d& world_from_object);  // by the end of step()
  void setVelocity(Id id, const Eigen::Vector3d& linear, const Eigen::Vector3d& angular);
  void setMass(Id id, const MassProperties& mass);
  void setAcceleration(Id id, const Eigen::Vector3d& acceleration);  // m/s^2, until changed
  void setForce(Id id, const Eigen::Vector3d& force, const Eigen::Vector3d& torque);  // same
  void applyImpulse(Id id, const Eigen::Vector3d& impulse, const Eigen::Vector3d& point);
  // The same, for an impulse that acts over the whole next step: weight and impulse change the
  // velocity at its beginning (backward Euler), so that what is balanced does not move.
  void push(Id id, const Eigen::Vector3d& impulse, const Eigen::Vector3d& point);
  void wake(Id id);

  Eigen::Isometry3d pose(Id id) const;  // world_from_object
  Eigen::Vector3d center(Id id) const;  // of mass, m
  Eigen::Vector3d linearVelocity(Id id) const;
  Eigen::Vector3d angularVelocity(Id id) const;
  // Change of the velocity at `at` per impulse at `from`: (1/m) I - [r_at] I^-1 [r_from].
  Eigen::Matrix3d compliance(Id id, const Eigen::Vector3d& at, const Eigen::Vector3d& from) const;
  // Change of linear (m/s) and angular velocity (rad/s) by an impulse at a point.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> velocityChange(Id id, const Eigen::Vector3d& impulse,
                                                             const Eigen::Vector3d& point) const;
  Eigen::Matrix3d inertia(Id id) const;  // about the centre, world axes, kg m^2
  double kineticEnergy(Id id) const;     // J
  bool sleeping(Id id) const;
  int awakeCount() const;  // dynamic bodies

  // Advances by h in sub-steps that get finer the fewer bodies are awake. @return their number
  int step(double h);
  std::vector<ContactPoint> contacts() const;  // of the last sub-step
  // Where the given bodies, and those they reach through others, touch something rigid, or come
  // nearer to a plane than `reach` (m) and what their own velocities make of it in h (s).
  std::vector<RigidTouch> touchesAround(std::set<Id> ids, double reach, double h) const;
  // Pairs that met during the last step; times since its beginning.
  const std::vector<TouchEvent>& touches() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calipso::fem
