#pragma once

#include <deque>
#include <set>
#include <string>
#include <vector>

#include "actor.hpp"
#include "calipso_fem/world/soft_contacts.hpp"
#include "calipso_fem/world/world.hpp"

namespace calipso::fem {

struct World::Impl {
  Impl(WorldScene scene, WorldParams params);

  // Clock (world.cpp)
  void stepFrame(double h);
  void substep(double from, double h);
  void rememberFirstTouches();
  ObjectSnapshot snapshot(const Actor& actor) const;

  // Bodies (world_bodies.cpp)
  Eigen::Isometry3d poseOf(const Actor& actor, double at) const;
  BodyMotion motionOf(const Actor& actor) const;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> verticesOf(const Actor& actor) const;
  Eigen::Vector3d centroidOf(const Actor& actor) const;
  void findHolder(Actor& actor);
  void become(Actor& actor, ObjectKind kind, const std::string& reason);
  void rebuild(Actor& actor);
  void makeRigid(Actor& actor, const BodyMotion& motion);
  void makeSoft(Actor& actor, const BodyMotion& motion, bool settle);
  void settleAsObserved(Actor& actor, const TriangleMesh& surface);
  void removeBodies(Actor& actor);
  void reset(Actor& actor);
  void addColliders();
  void addCollider(Actor& actor);
  const std::vector<TriangleMesh>& hullsOf(Actor& actor);
  void wake(Actor& actor);

  // Contacts and forces of a step (world_step.cpp)
  std::vector<Obstacle> obstacles(double from, double to, const Actor* except = nullptr);
  std::vector<SoftEntry> softEntries();
  void applyPulls(double at);
  void pullSoft(Actor& actor, const Pull& pull, double at);
  void pullRigid(Actor& actor, double at);
  void endPulls(double at);
  void updateSleep();
  int substepsPerFrame() const;

  // Edits (world_edits.cpp)
  std::string apply(const Edit& edit);
  std::string transform(Actor& actor, const Edit& edit);
  std::string pull(Actor& actor, const Edit& edit);
  std::string fix(Actor& actor, const Edit& edit);
  std::string release(Actor& actor, const Edit& edit);
  std::string changeMaterial(Actor& actor, const Edit& edit);
  std::string changeGravity(const Edit& edit);
  std::string changeVelocity(Actor& actor, const Edit& edit);
  void touch(Actor& actor, const Edit& edit);
  ObjectKind kindFor(const Actor& actor, const Edit& edit) const;
  Actor* find(const std::string& name);
  std::vector<std::string> names() const;

  WorldScene scene;
  WorldParams params;
  std::vector<Actor> actors;
  RigidWorld rigid;
  SoftContacts contacts;
  std::vector<RigidWorld::Id> supports;  // planes and meshes in the rigid world
  std::vector<std::unique_ptr<SurfaceTree>> support_trees;
  bool has_colliders = false;

  double now = 0.0;
  bool started = false;
  double step_ms = 0.0;
  int substeps = 0;
  std::vector<ContactPoint> shown_contacts;
  std::set<std::pair<std::string, std::string>> touching;
  std::deque<Edit> pending;  // by time
  bool plan_changed = true;
};

// Edge length of the cells and all other FEM options for an object, from its size in the picture.
FemOptions chooseFem(const TriangleMesh& surface, const Camera& camera, const WorldParams& params,
                     const ObjectSettings& settings);

}  // namespace calipso::fem
