#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "calipso_fem/world/contact_solver.hpp"
#include "calipso_fem/world/rigid_world.hpp"
#include "calipso_fem/world/soft_object.hpp"
#include "calipso_fem/world/surface_tree.hpp"

namespace calipso::fem {

// Something a deformable object can meet: a plane, a surface that stands, is moved or is rigid, or
// another deformable object. Pointers are borrowed for one step.
struct Obstacle {
  int id = 0;  // unique and lasting
  std::string name;
  SurfaceSettings surface;
  const SupportPlane* plane = nullptr;
  const SurfaceTree* tree = nullptr;                                // in its own frame
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();           // world_from_tree, end of step
  Eigen::Isometry3d previous_pose = Eigen::Isometry3d::Identity();  // start of step
  std::optional<RigidWorld::Id>
      rigid;  // dynamic rigid body: pose is still that at the step's start
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // of the rigid body, m/s^2
  SoftObject* soft = nullptr;
};

struct SoftEntry {
  int id = 0;  // unique and lasting, shared with its Obstacle
  std::string name;
  SurfaceSettings surface;
  SoftObject* soft = nullptr;
  bool asleep = false;
};

struct ContactParams {
  double proximity = 5e-3;  // m, surfaces closer than this are watched
  int iterations = 60;
  double tolerance = 1e-6;
  int passes = 3;               // exact corrections per step
  double allowed_depth = 1e-5;  // m, ends the passes
};

struct ContactReport {
  int contacts = 0;
  int iterations = 0;  // Gauss-Seidel sweeps, all passes together
  int passes = 0;
  double deepest = 0.0;  // m, after the last pass
};

// Contacts of deformable objects with everything else. Surface vertices are the primitives, tested
// against the other's surface in both directions, by distance and, against tunnelling, along their
// way of this step. The impulse of the last step enters the next free motion as a force, so that at
// rest nothing is left to correct.
class SoftContacts {
 public:
  explicit SoftContacts(const ContactParams& params) : params_(params) {}

  // Points where `entry` touches or is nearer to an obstacle than `reach`, deepest per carrier
  // node.
  // @return hold points with, for each, the obstacle's index
  std::vector<std::pair<HoldPoint, int>> touching(const SoftEntry& entry,
                                                  const std::vector<Obstacle>& obstacles,
                                                  double reach) const;
  // Contacts that hold an object at its start: forces, offsets and what exceeds the friction cone
  // are kept, so that the observed state is an equilibrium.
  void hold(const SoftEntry& entry, const Obstacle& obstacle, const HoldPoint& point, double reach);

  // Gives the impulses of the last step to the bodies as forces; call before their free motion.
  void pushOn(const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
              RigidWorld& rigid, double h);
  // Corrects the free motion of the step of length h (s).
  ContactReport solve(const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
                      RigidWorld& rigid, double h);

  void forget(int id);                        // object or obstacle
  void setRule(int a, int b, const PairRule& rule);
  const std::vector<ContactPoint>& contacts() const { return contacts_; }

 private:
  // Which contact: (deformable, obstacle, carrier node or the obstacle's vertex, its side).
  using Key = std::tuple<int, int, int, bool>;
  struct Memory {
    SurfacePoint point, other;  // on the deformable; on the obstacle if it is deformable
    Eigen::Vector3d place = Eigen::Vector3d::Zero();  // on the obstacle, world
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  // on the deformable, N
    double offset = 0.0;  // gap at which the surfaces count as touching, m
    double held_normal = 0.0, held_tangential = 0.0;  // N
  };
  struct Touch {
    Key key;
    int soft = 0, obstacle = 0;  // indices of the step's lists
    SurfacePoint point, other;
    Eigen::Vector3d place = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::UnitZ();
    double gap = 0.0;  // m
  };
  using Touches = std::map<Key, Touch>;

  bool meets(int a, int b) const;
  double frictionOf(const SoftEntry& entry, const Obstacle& obstacle) const;
  Touches collect(const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
                  double reach) const;
  void addVertices(const SoftEntry& entry, int soft, const Obstacle& obstacle, int index,
                   double reach, Touches& touches) const;
  void addObstacleVertices(const SoftEntry& entry, int soft, const Obstacle& obstacle, int index,
                           double reach, Touches& touches) const;
  void offer(const Touch& touch, double reach, Touches& touches) const;
  ContactRow rowOf(const Touch& touch, const SoftEntry& entry, const Obstacle& obstacle,
                   const RigidWorld& rigid, double h) const;
  const Eigen::MatrixXd& complianceOf(const Touches& touches, const std::vector<SoftEntry>& softs,
                                      const std::vector<Obstacle>& obstacles,
                                      const RigidWorld& rigid, double h);
  void correct(const Touches& touches, const std::vector<Eigen::Vector3d>& impulses,
               const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
               RigidWorld& rigid, double h);
  Touches releaseLost(const Touches& touches, const std::vector<SoftEntry>& softs,
                      const std::vector<Obstacle>& obstacles) const;
  void publish(const Touches& touches, const std::vector<SoftEntry>& softs,
               const std::vector<Obstacle>& obstacles);

  ContactParams params_;
  std::map<Key, Memory> memory_;
  std::map<std::pair<int, int>, PairRule> rules_;
  std::vector<ContactPoint> contacts_;
  // Compliance of the last contact set; while the set stays, it stays good enough to iterate with,
  // since the corrections themselves are exact.
  Eigen::MatrixXd W_;
  std::vector<std::pair<Key, Eigen::Vector3d>> W_of_;  // contacts and their normals
  double W_step_ = 0.0;
};

}  // namespace calipso::fem
