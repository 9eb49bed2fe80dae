#pragma once

#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actor.hpp"
#include "calipso_fem/world/convex_decomposition.hpp"
#include "calipso_fem/world/hull_store.hpp"
#include "calipso_fem/world/soft_contacts.hpp"
#include "calipso_fem/world/wind.hpp"
#include "calipso_fem/world/world.hpp"

namespace calipso::fem {

struct ObservedGravity {
  Eigen::Vector3d vector;  // m/s^2
  double deviation;        // of its length
};

// Points of an object's surface, each with the index of the obstacle it touches.
using Touching = std::vector<std::pair<HoldPoint, int>>;
std::vector<HoldPoint> pointsOf(const Touching& touching);

struct World::Impl {
  Impl(WorldScene scene, WorldParams params);

  // Clock (world.cpp)
  void stepFrame(double h);

  // Contacts that the video has seen (observed_contact.cpp)
  struct Continued {
    int id;
    BodyMotion motion;
    Eigen::Vector3d center;  // of mass, m
  };
  void noteWhatContinues(const Edit& edit, const std::vector<bool>& fresh);
  bool agreesWithVideo(const Actor& actor) const;
  std::vector<Continued> continued() const;
  bool touchesInStep(Actor& actor, double from) const;
  void actAsObserved(const std::vector<Continued>& list, double from);
  void substep(double from, double span);
  bool stepSofts(const std::vector<SoftEntry>& softs, double at, double part);
  int stepRigids(double at, double part);
  void rememberFirstTouches();
  void noteTouch(const TouchEvent& touch);  // unless the pair has been noted in this frame
  ObjectSnapshot snapshot(const Actor& actor) const;

  // Bodies (world_bodies.cpp)
  Eigen::Isometry3d poseOf(const Actor& actor, double at) const;
  BodyMotion motionOf(const Actor& actor) const;
  BodyMotion seenMotionOf(const Actor& actor) const;  // in the video
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> verticesOf(const Actor& actor) const;
  Eigen::Vector3d centroidOf(const Actor& actor) const;
  void become(Actor& actor, ObjectKind kind, const std::string& reason);
  // A body to come. It is made before anything changes: an object of which none can be made stays
  // as it is.
  struct Body {
    ObjectKind kind;
    BodyMotion motion;
    RigidBodySpec rigid;               // of a rigid one
    std::unique_ptr<SoftObject> soft;  // of a deformable one
  };
  // @throw std::invalid_argument: none can be made
  Body bodyOf(const Actor& actor, const TriangleMesh& mesh, ObjectKind kind,
              const BodyMotion& motion);
  void enter(Actor& actor, Body body, bool settle);  // in place of the body it has
  std::vector<std::string> overlapsOf(const Actor& actor, const TriangleMesh& surface);
  void noteOverlaps(Actor& actor, const TriangleMesh& surface);
  void makeRigid(Actor& actor, const RigidBodySpec& spec);
  void makeSoft(Actor& actor, Body body, bool settle);
  // Where edits have placed the key frame's shape, at rest: what deforms in the video starts there,
  BodyMotion keyPlaceOf(const Actor& actor) const;
  void deformAsObserved(Actor& actor);  // with shape and velocity as in the video at this instant
  Vec nodalModes(const Actor& actor, const Vec& amplitudes) const;
  // The same body in the same state, with the material it was observed with and not held.
  std::unique_ptr<SoftObject> twinOf(const Actor& actor, const TriangleMesh& mesh,
                                     const FemOptions& options) const;
  void removeBodies(Actor& actor);
  void reset(Actor& actor);
  // Friction, restitution and proximity of one object's surface, in all its contacts.
  void setSurface(Actor& actor, const SurfaceSettings& surface);
  // Objects or supports by name. Empty b: a and everything; then a rule already given stays.
  void setPairContact(const std::string& a, const std::string& b, bool on);
  std::vector<std::string> allBut(const std::string& name) const;  // objects and supports
  void setPairRule(const std::string& a, const std::string& b, const PairRule& rule);
  PairRule pairRule(const std::string& a, const std::string& b) const;
  bool meet(int a, int b) const;  // ids
  bool meetsItself(const Actor& actor) const;
  void watchItself(Actor& actor);  // or not, as meetsItself() says
  void setSelfRule(Actor& actor, const PairRule& rule);
  std::vector<int> ownSupports(const WorldObject& object) const;  // ids
  void meetOwnSupports(Actor& actor,
                       bool contact);  // nothing is to meet them once it moves or is gone
  void keepOwnSupportsOut();           // of what has moved, also for what is new
  // What pairs were before edits changed them; for a reset.
  void rememberRules(const std::string& object, const std::string& other);
  void restoreRules(const std::string& object);
  // A new object takes part from now on, at its world_from_object; static until an edit touches it.
  Actor& addObject(const WorldObject& object, const ObjectSettings& settings);
  // A copy in the present state (shape, velocity, material, gravity), moved by `motion` (world).
  // Attachments and what holds the original are not copied.
  Actor& duplicate(const std::string& source, const std::string& name,
                   const Eigen::Isometry3d& motion);
  int freeIndex() const;  // a label that no object has
  void copySoft(Actor& copy, const Actor& source, const Eigen::Isometry3d& motion);
  void addColliders();
  void addCollider(Actor& actor);
  void wake(Actor& actor);
  bool sleeps(const Actor& actor) const;

  // What held an object in the video (world_settle.cpp)
  void findHolder(Actor& actor);
  std::vector<int> attachedOf(const Actor& actor) const;  // vertices that the video shows held
  Touching supportPoints(const Actor& actor, const TriangleMesh& surface,
                         const std::vector<Obstacle>& around) const;
  void limitSag(Actor& actor, const TriangleMesh& surface, std::vector<HoldPoint> hold);
  void settleAsObserved(Actor& actor, const TriangleMesh& surface,
                        const std::vector<Obstacle>& around, const Touching& support);

  // Objects that rest on others (world_rests.cpp)
  // As the video has it, before the carrier leaves its place there.
  void noteWhatRestsOn(const Actor& carrier);
  void letGoWhatLostItsRest();
  struct Rest;
  void setPressing(const Rest& rest, bool presses);

  // Objects of the video in the way of edited ones (world_strikes.cpp)
  ObjectKind kindWhenFree(const Actor& actor) const;
  bool canBeStruck(const Actor& actor) const;
  double closingSpeedOf(const Actor& striker, const Actor& struck, double h);
  bool isStruckHard(const Actor& actor, const Actor& striker, double h);
  bool strikesInVideo(const Actor& striker, const Actor& struck, double h) const;
  void letGo(Actor& actor, const std::string& why);
  void releaseWhatIsStruck(double h);  // within the next h

  // Contacts and forces of a step (world_step.cpp)
  // @param except  is left out, with the supports that are its own surface
  std::vector<Obstacle> obstacles(double from, double to, const Actor* except = nullptr);
  void addSupports(std::vector<Obstacle>& list) const;
  Obstacle obstacleOf(Actor& actor, double from, double to);
  std::vector<SoftEntry> softEntries();
  Vec driveTo(Actor& actor, double to, double h);  // world_forces.cpp
  void driveAsObserved(double to, double h);
  void endDrive(Actor& actor);
  void noteNoDrive(Actor& actor);
  void applyLoads(double at, double h);  // world_forces.cpp
  Eigen::Vector3d twistOf(const Actor& actor, const Pull& pull, double at, double h) const;
  void twistSoft(Actor& actor, const Pull& pull, double at);
  Vertices airOn(Actor& actor, const Vertices& x, const Vertices& u, double at, double h);
  void blowSoft(Actor& actor, double at, double h);
  void pullSoft(Actor& actor, const Pull& pull, double at);
  void loadRigid(Actor& actor, double at, double h);
  void endPulls(double at);
  double wayOf(const Actor& actor, double h) const;
  bool isDisturbed(const Actor& actor, double h) const;
  void wakeAround(const Actor& actor);
  Eigen::AlignedBox3d boxNear(const Actor& actor) const;
  void wakeDisturbed(double h);
  void updateSleep(double h);
  int substepsPerFrame() const;

  // Edits (world_edits.cpp, world_loads.cpp, world_scene_edits.cpp)
  void enqueue(const Edit& edit);
  void releaseWaiting();
  std::string apply(const Edit& edit);
  std::string carryOut(const Edit& edit);
  std::string applyToScene(const Edit& edit);
  std::string transform(Actor& actor, const Edit& edit);
  std::string pull(Actor& actor, const Edit& edit);
  std::string fix(Actor& actor, const Edit& edit);
  std::string release(Actor& actor, const Edit& edit);
  std::string press(Actor& actor, const Edit& edit);
  std::string blow(Actor& actor, const Edit& edit);
  std::string blowEverywhere(const Edit& edit);
  const WindTrack& windFor(
      const Actor& actor) const;  // @throw std::invalid_argument when the video shows none
  std::string insert(const Edit& edit);
  void lead(Actor& actor, Pull& pull, double gone);
  void holdAnew(Actor& actor);  // of a deformable one
  void moveBy(Actor& actor, const Eigen::Isometry3d& motion);
  void scale(Actor& actor, double factor);
  std::string remove(Actor& actor);
  std::string copy(Actor& actor, const Edit& edit);
  std::string changeContact(Actor& actor, const Edit& edit);
  std::string changeLook(Actor& actor, const Edit& edit);
  std::string changeKind(Actor& actor, const Edit& edit);
  std::string changeMaterial(Actor& actor, const Edit& edit);
  bool tellsDensity(Actor& actor, const Edit& edit);
  void setMaterial(Actor& actor, const Edit& edit, const Material& material);
  std::string makeImmovable(Actor& actor, const Edit& edit, const Material& material);
  std::string changeGravity(const Edit& edit);
  void applyGravity(Actor& actor);  // and buoyancy, as they are from now on
  void setVelocity(Actor& actor, const Eigen::Vector3d& linear, const Eigen::Vector3d& angular);
  std::string changeVelocity(Actor& actor, const Edit& edit);
  void checkThere(const Actor& actor) const;  // @throw std::invalid_argument: it was removed
  void touch(Actor& actor, const Edit& edit);
  // An edit of the whole scene passes over what it cannot touch. @return why that stays; empty: it
  // was touched
  std::string touchIfPossible(Actor& actor, const Edit& edit);
  ObjectKind kindFor(const Actor& actor, const Edit& edit) const;
  int idOf(const std::string& name) const;  // of an object or a support
  std::optional<RigidWorld::Id> rigidIdOf(int id) const;
  void applyRules(const Actor& actor);
  Actor* find(const std::string& name);
  Actor& known(const std::string& object,
               const char* what);  // @throw std::invalid_argument: what of an unknown one
  std::vector<std::string> names() const;

  WorldScene scene;
  WorldParams params;
  std::deque<Actor> actors;  // grows without moving what is there
  RigidWorld rigid;
  SoftContacts contacts;
  std::vector<RigidWorld::Id> supports;  // planes and meshes in the rigid world
  std::vector<std::unique_ptr<SurfaceTree>> support_trees;
  bool has_colliders = false;
  // An object that nothing but another one carries, and the place on that one's surface where it
  // does.
  struct Rest {
    int actor, carrier, triangle;
    Eigen::Vector3d barycentric, place;
  };
  std::vector<Rest> rests;

  double now = 0.0;  // video time, s
  std::optional<ObservedGravity> observed_gravity;
  Eigen::Vector3d gravity_now = Eigen::Vector3d::Zero();  // the scene's, as edits have it, m/s^2
  std::optional<Edit> wind_now;                           // around everything, by an edit
  double speed_scale = 1.0;  // simulated seconds per second of the video
  double part_begin = 0.0;   // video time, s, at which the part of a step under way begins
  Sun sun;
  bool started = false;
  double step_ms = 0.0;
  int substeps = 0;
  // s, of a step, at which deformable objects converge
  double soft_part = std::numeric_limits<double>::infinity();
  int good_parts = 0;  // in a row, of that length
  std::vector<ContactPoint> shown_contacts;
  std::set<std::pair<std::string, std::string>> touching;
  std::vector<TouchEvent> first_touches;
  std::map<std::pair<int, int>, PairRule> rules;                         // by ids, smaller first
  std::map<std::pair<std::string, std::string>, PairRule> rules_before;  // any edit, by names
  std::deque<Edit> pending;                                              // by time
  std::vector<Edit> waiting;  // for a collision in the video that is not known yet
  bool collisions_known = false;
  bool plan_changed = true;

  HullStore hulls{[](const TriangleMesh& mesh) { return decomposeConvex(mesh); }};
};

// Defaults completed by what the user set. (world.cpp)
Material observedMaterial(const WorldObject& object, const ObjectSettings& settings,
                          const Eigen::Vector3d& gravity);
// @throw std::invalid_argument naming the object and what is wrong with it (world.cpp)
void validateScene(const WorldScene& scene);
TriangleMesh placed(const TriangleMesh& mesh, const Eigen::Isometry3d& pose);  // world_bodies.cpp
// Object frame, m; of what is flat, the mean of its vertices. (world_bodies.cpp)
Eigen::Vector3d centerOfMass(const Actor& actor);
double massOf(const Actor& actor);  // kg. @pre not flat, or deformable (world_bodies.cpp)
// A sheet that is meant to bend: thin, and large for its volume (m^3). world_settle.cpp
bool isCloth(const TriangleMesh& surface, double volume);
// Whether it moves by a part of its size that counts to the next frame. (world_rests.cpp)
bool isOnTheMove(const ObservedMotion& seen, double size, double frame_period);

// Alignment leaves supported objects a little above or inside their support: gaps up to this share
// of the object's diagonal count as contact, and wider ones of what rests in the video.
constexpr double kSupportGap = 0.02, kRestingGap = 0.06;

// Lasting id of the k-th support, planes first; objects have ids from 0 up.
constexpr int supportId(size_t k) { return -1 - static_cast<int>(k); }

double pixelsPerMeter(const Camera& camera,
                      const Eigen::Vector3d& at);  // 0 where it cannot be seen

// Edge length of the cells and all other FEM options for an object, from its size in the picture.
FemOptions chooseFem(const TriangleMesh& surface, const Camera& camera, const WorldParams& params,
                     const ObjectSettings& settings);

}  // namespace calipso::fem
