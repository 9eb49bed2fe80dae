#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
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
  const SurfaceTree* tree = nullptr;                       // in its own frame, at the start
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // world_from_tree, end of step
  Eigen::Isometry3d previous_pose = Eigen::Isometry3d::Identity();  // start of step
  std::optional<RigidWorld::Id> rigid;  // dynamic rigid body: both poses are those at the start
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // of the rigid body, m/s^2
  SoftObject* soft = nullptr;
};

struct SoftEntry {
  int id = 0;  // unique and lasting, shared with its Obstacle
  std::string name;
  SurfaceSettings surface;
  SoftObject* soft = nullptr;
};

struct ContactParams {
  double proximity = 5e-3;  // m, surfaces closer than this are watched
  int iterations = 120;     // Gauss-Seidel sweeps per solve
  // of allowed_depth: sweeps that change the ways of the surfaces by less are the last
  double tolerance = 0.5;
  int newton_iterations = 30;
  double allowed_depth = 3e-6;  // m, remaining violation that ends a step's iteration,
  double residual = 1e-3;       // with this of bodies in contact, over their forces
};

struct ContactReport {
  int contacts = 0;
  int iterations = 0;  // Gauss-Seidel sweeps of the step
  int newton_iterations = 0;
  int renewals = 0;      // of kept tangents
  double deepest = 0.0;  // m, where the step ended
  bool converged = true;
  std::vector<StepReport> bodies;  // as the softs

  void add(const ContactReport& other);  // of bodies beside these; `bodies` stays
};

// A contact of a step: the gap between a surface point of a deformable object (a) and a point of
// what it meets (b), linear in their motion, gap = start_gap + slack + normal . (d_a - d_b).
struct Contact {
  // Crossings of a surface by itself count the triangles, in steps of four.
  enum Found { kNearest = 0, kNearestReversed = 1, kCrossing = 2, kCrossingReversed = 3 };
  // (deformable, obstacle, vertex, how it was found): one vertex may touch two sides of a corner.
  using Key = std::tuple<int, int, int, int>;
  Key key;
  int soft_a = -1, soft_b = -1;  // indices of the step's list
  int obstacle = -1;             // index
  std::optional<RigidWorld::Id> rigid_a, rigid_b;
  bool ofOneBody() const { return soft_a >= 0 && soft_a == soft_b; }
  SurfacePoint point, other;                          // on a; on b if it is deformable
  Eigen::Vector3d place = Eigen::Vector3d::Zero();    // of b at the start, world; force acts here
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // from b to a
  Eigen::Vector3d motion = Eigen::Vector3d::Zero();   // d_b where b is moved by nobody's force, m
  double start_gap = 0.0;                             // m
  double slack = 0.0;  // what the linear gap was wrong by where the step ends, m
  double reach = 0.0;  // m, minimal distance of the pair
  double friction = 0.0;
  double offset = 0.0;                              // gap at which the surfaces touch, m
  double held_normal = 0.0, held_tangential = 0.0;  // N
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  // on a, N
};

class Anderson;
class ContactOperator;
class StepMotion;

// Steps deformable objects together with their contacts: backward Euler with the conditions
//   0 <= gap(x_end)  _|_  f_n >= 0,   |f_t| <= mu f_n opposite to the slip over the step.
// Newton on the incremental potentials of all bodies with kept tangents. Each direction solves the
// contacts' laws by block Gauss-Seidel with the compliance H A^-1 H^T (Saupin et al. 2008) of the
// same tangents, so that it obeys them however old these are; a tangent is renewed when the
// iteration would take longer than that. Gaps are measured at the start of the step and taken
// along, and measured again where the step ends; a point that is further away becomes a contact
// when its way crosses a surface.
class SoftContacts {
 public:
  explicit SoftContacts(const ContactParams& params);
  ~SoftContacts();

  // Surface vertices of `entry` that touch or are nearer to an obstacle than `reach`.
  // @return hold points with, for each, the obstacle's index
  std::vector<std::pair<HoldPoint, int>> touching(const SoftEntry& entry,
                                                  const std::vector<Obstacle>& obstacles,
                                                  double reach) const;
  // Contacts that hold an object at its start: forces, offsets and what exceeds the friction cone
  // are kept, so that the observed state is an equilibrium.
  void hold(const SoftEntry& entry, const Obstacle& obstacle, const HoldPoint& point, double reach);

  // One step of length h (s) of all `softs`; rigid bodies get their share as impulses.
  // @return without bodies where the step is too long for them: nothing has changed then
  ContactReport step(const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
                     RigidWorld& rigid, double h);

  void forget(int id);  // object or obstacle
  void setRule(int a, int b, const PairRule& rule);
  const std::vector<ContactPoint>& contacts() const { return contacts_; }

 private:
  using Key = Contact::Key;
  struct Memory {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  // on the deformable, N
    double offset = 0.0;                              // m
    double held_normal = 0.0, held_tangential = 0.0;  // N
    bool holds = false;  // from hold(): the offset stays until the surfaces part
  };
  using Contacts = std::map<Key, Contact>;
  // A vertex that may meet an obstacle in this step, and the obstacle's nearest point.
  struct Candidate {
    Contact contact;
    bool reversed = false;  // the obstacle's vertex against the deformable's surface
    int vertex = 0;
    bool near = false;  // within the minimal distance at the start
  };

  // Deformable objects that may act on each other in a step, and how it went for them.
  struct Island;
  // Whether contacts between the two are allowed does not count: that a pair which never touches is
  // excluded must not change a bit.
  std::vector<Island> islandsOf(const std::vector<SoftEntry>& softs,
                                const std::vector<Obstacle>& obstacles, const RigidWorld& rigid,
                                double h) const;
  // The iteration of a step (soft_contact_iteration.cpp)
  struct Surroundings {
    const std::vector<Candidate>& watched;
    const std::vector<Obstacle>& obstacles;
    RigidWorld& rigid;
  };
  struct Progress;
  void solveIsland(const std::vector<Obstacle>& obstacles, RigidWorld& rigid, double h,
                   Island& island) const;
  void iterate(const Surroundings& around, Island& island, Progress& p) const;
  void straightenWhereDue(const Surroundings& around, Island& island, Progress& p) const;
  // Distance from which on something may come within the minimal distance in the step, m.
  double watchOf(const SoftEntry& entry, const Obstacle& obstacle, const RigidWorld& rigid,
                 double h) const;

  using Neighbourhood = std::tuple<int, int, int, int>;
  Neighbourhood neighbourhoodOf(const Contact& c, const std::vector<SoftEntry>& softs) const;

  bool meets(int a, int b) const;
  double frictionOf(const SoftEntry& entry, const Obstacle& obstacle) const;
  double reachOf(const SoftEntry& entry, const Obstacle& obstacle) const;

  // Detection (soft_contact_detection.cpp)
  std::vector<Candidate> candidates(const std::vector<SoftEntry>& softs,
                                    const std::vector<Obstacle>& obstacles, const RigidWorld& rigid,
                                    double h) const;
  void watchPair(const std::vector<SoftEntry>& softs, int soft,
                 const std::vector<Obstacle>& obstacles, int obstacle, const RigidWorld& rigid,
                 double h, std::vector<Candidate>& list) const;
  struct WatchedPair;
  void watchOwnVertices(const WatchedPair& pair, const std::vector<SoftEntry>& softs,
                        std::vector<Candidate>& list) const;
  void watchTheirVertices(const WatchedPair& pair, const std::vector<SoftEntry>& softs,
                          std::vector<Candidate>& list) const;
  void watchVertex(const WatchedPair& pair, const std::vector<SoftEntry>& softs, Contact contact,
                   bool reversed, int vertex, std::vector<Candidate>& list) const;
  // The surface of a deformable object against itself (self_contact_detection.cpp).
  void watchSelf(const std::vector<SoftEntry>& softs, int soft,
                 const std::vector<Obstacle>& obstacles, double h,
                 std::vector<Candidate>& list) const;
  std::optional<Contact> crossingItself(const Candidate& c, const std::vector<SoftEntry>& softs,
                                        const StepMotion& motion) const;
  // Candidates that the trial motion violates become contacts. @return how many were added
  int grow(const std::vector<Candidate>& list, const std::vector<Obstacle>& obstacles,
           const std::vector<SoftEntry>& softs, const StepMotion& motion, Contacts& contacts) const;
  std::optional<Contact> crossing(const Candidate& c, const std::vector<Obstacle>& obstacles,
                                  const std::vector<SoftEntry>& softs,
                                  const StepMotion& motion) const;
  // Gaps and normals become those at the targets (soft_contact_geometry.cpp). @return how many were
  // off
  int straighten(const std::vector<Candidate>& watched, const std::vector<Obstacle>& obstacles,
                 const std::vector<SoftEntry>& softs, const StepMotion& motion,
                 Contacts& contacts) const;
  Contact completed(Contact contact) const;  // with what is remembered of its key

  Contacts startingContacts(const std::vector<Candidate>& watched,
                            const std::vector<Obstacle>& obstacles,
                            const std::vector<SoftEntry>& softs, const RigidWorld& rigid,
                            const StepMotion& motion) const;
  // Contact forces of the direction that the bodies have aimed at. @return sweeps
  int solve(const ContactOperator& problem, const StepMotion& motion, Contacts& contacts) const;
  Contacts expectedContacts(const std::vector<Candidate>& watched, const Contacts& contacts,
                            const StepMotion& motion) const;
  double residualWanted(int iteration) const;  // of bodies with contacts
  bool isOpen(const Contacts& contacts, const StepMotion& motion, double wanted) const;
  bool renewStale(const Contacts& contacts, double wanted, StepMotion& motion,
                  std::vector<int>& renewals) const;
  int direct(const std::vector<SoftEntry>& softs, RigidWorld& rigid, bool first,
             ContactOperator& problem, StepMotion& motion, Contacts& contacts) const;
  bool tooFast(const std::vector<Candidate>& watched, const std::vector<SoftEntry>& softs,
               double h) const;
  bool unbalanced(const StepMotion& motion, size_t soft, double wanted) const;
  bool acceptable(const Contacts& contacts, const StepMotion& motion) const;
  void addRigidTouches(const std::vector<Candidate>& watched, const std::vector<SoftEntry>& softs,
                       const RigidWorld& rigid, double h, Contacts& contacts) const;
  void forgetForces();
  void remember(const Contacts& contacts, const StepMotion& motion);
  void publish(const Contacts& contacts, const StepMotion& motion,
               const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles);

  ContactParams params_;
  std::map<Key, Memory> memory_;
  std::map<std::pair<int, int>, PairRule> rules_;
  std::vector<ContactPoint> contacts_;
};

}  // namespace calipso::fem
