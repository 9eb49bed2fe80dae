#pragma once

#include <memory>
#include <string>
#include <vector>

#include "calipso_fem/world/observed_wind.hpp"
#include "calipso_fem/world/world_types.hpp"

namespace calipso::fem {

// The whole scene, simulated in video time. The observed motion is the reference: an object is as
// in the video until an edit touches it; then it starts from its observed pose and velocity, in
// equilibrium with what held it (attachments, supports, or buoyancy equal to its weight), and is
// modelled as simply as the edits known so far allow: kinematic, rigid (Bullet) or deformable
// (FEM). Deterministic; not thread-safe.
class World {
 public:
  // @throw std::invalid_argument naming what is wrong with scene or parameters
  World(WorldScene scene, WorldParams params);
  ~World();

  // Motion of one object at one instant of the video.
  // @throw std::invalid_argument naming the object and the ones there are
  void addObservedMotion(const std::string& object, const ObservedMotion& motion);

  // Gravity (m/s^2) as an object in free flight shows it; the surest of several counts.
  // @param deviation standard deviation of its length, m/s^2
  void addObservedGravity(const Eigen::Vector3d& gravity, double deviation);

  // The wind at one instant as the cloth of an object shows it. Objects that are not there are
  // passed over.
  void addObservedWind(const std::string& object, const ObservedWind& wind);

  // The shapes phi (3 #V x K, object frame) in which an object deforms in the video; ObservedMotion
  // has their amplitudes. @throw std::invalid_argument: no such object, or shapes of another mesh
  void addObservedModes(const std::string& object, const Eigen::MatrixXd& shapes);

  // The instant (s) of an object's next collision in the video; they come in order. Objects that
  // are not there are passed over.
  void addCollision(const std::string& object, double time);
  // No more collisions will come: an edit that waits for another one is refused.
  void allCollisionsKnown();

  // Takes an edit in; it takes effect with the first frame at or after its time. Never throws: what
  // is wrong with it is said in its outcome.
  void submit(const Edit& edit);

  // Contact between two objects or supports, by name; an empty b stands for everything. An edit
  // 'reset' leaves rules, and gives an object back the surface of its parameters.
  // @throw std::invalid_argument naming what is not known, or the value and its range
  void setPairContact(const std::string& a, const std::string& b, bool on);
  void setPairRule(const std::string& a, const std::string& b, const PairRule& rule);
  PairRule pairRule(const std::string& a, const std::string& b) const;
  void setSurface(const std::string& object, const SurfaceSettings& surface);

  // A new object takes part from now on. @throw std::invalid_argument: name taken, bad mesh
  void addObject(const WorldObject& object, const ObjectSettings& settings);
  // A copy in the present state (shape, velocity, material, gravity), moved by `motion` (world).
  void duplicate(const std::string& source, const std::string& name,
                 const Eigen::Isometry3d& motion);

  // Steps to video time `time` (s) and applies the edits due by then. The first call sets the
  // clock. Times that do not increase step nothing. @return what became of the edits that were due
  std::vector<EditOutcome> advanceTo(double time);

  double time() const;
  WorldState state() const;
  std::vector<PlanEntry> plan() const;
  // Begins, in a thread of its own, what edits would else wait for: live video goes on meanwhile.
  void prepareForEdits();
  bool planChanged();  // since it was last asked

  const WorldScene& scene() const;
  // For drawing: the volume grid's edges and fixed nodes of a deformable object, user forces.
  struct Drawing {
    std::string object;
    double mass = 0.0;                   // kg, as simulated; 0: it is not
    std::vector<Eigen::Vector3d> edges;  // pairs of points, world
    std::vector<Eigen::Vector3d> fixed;  // points, world
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> forces;  // point, N
  };
  std::vector<Drawing> drawings() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calipso::fem
