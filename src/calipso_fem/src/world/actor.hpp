#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calipso_fem/world/observed_track.hpp"
#include "calipso_fem/world/observed_wind.hpp"
#include "calipso_fem/world/rigid_world.hpp"
#include "calipso_fem/world/soft_object.hpp"
#include "calipso_fem/world/surface_tree.hpp"
#include "calipso_fem/world/world_types.hpp"
#include "observed_drive.hpp"

namespace calipso::fem {

// A pull that is still acting.
struct Pull {
  std::vector<int> vertices;
  std::vector<int> nodes;  // deformable, target mode: the nodes that are led
  bool to_target = false;
  bool twists = false;                               // turns the region about its middle
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();  // N or m; twisting N m or rad
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  // object frame, centre of the region
  Eigen::Vector3d start = Eigen::Vector3d::Zero();   // world, where the anchor was
  Eigen::Matrix3d start_rotation = Eigen::Matrix3d::Identity();  // of the object
  double begin = 0.0, ramp = 0.0, duration = 0.0;                // s

  double share(double time) const {  // 0..1 along the ramp
    return ramp > 0.0 ? std::min(1.0, std::max(0.0, (time - begin) / ramp)) : 1.0;
  }
  // Displacement of a point at `arm` from the region's middle, `share` of the way to the target.
  Eigen::Vector3d way(double share, const Eigen::Vector3d& arm) const {
    if (!twists) return share * vector;
    const double angle = vector.norm();
    if (angle == 0.0) return Eigen::Vector3d::Zero();
    return Eigen::AngleAxisd(share * angle, vector / angle) * arm - arm;
  }
  // Where a point at `at` was from the region's middle, before it went `share` of the way.
  Eigen::Vector3d armOf(const Eigen::Vector3d& at, double share) const {
    const double angle = vector.norm();
    if (!twists || angle == 0.0) return at - start;
    return Eigen::AngleAxisd(-share * angle, vector / angle) * (at - start);
  }
  // The object was put elsewhere, or scaled about a point, after `share` of the way: the way to go
  // stays as the edit has it.
  void moveBy(const Eigen::Isometry3d& motion, double share) {
    const Eigen::Vector3d gone = (twists ? 0.0 : share) * vector;
    start = motion * (start + gone) - gone;
    const double angle = vector.norm();
    if (!twists || angle == 0.0) return;
    const Eigen::Matrix3d turned = Eigen::AngleAxisd(share * angle, vector / angle).matrix();
    start_rotation = turned.transpose() * motion.linear() * turned * start_rotation;
  }
  void scaleBy(double factor, const Eigen::Vector3d& about, double share) {
    const Eigen::Vector3d gone = (twists ? 0.0 : share) * vector;
    start = about + factor * (start + gone - about) - gone;
  }
  bool over(double time) const { return duration > 0.0 && time >= begin + duration - 1e-9; }
};

// Pose and velocity of a body as a whole, handed on when its kind changes.
struct BodyMotion {
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   // of the centre of mass, m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  // rad/s
};

// What is known about how the video holds an object, decided when an edit first touches it.
enum class Holder { kUnknown, kAttachment, kSupport, kBuoyancy, kNothing };

// One object of the simulated world.
struct Actor {
  explicit Actor(const WorldObject& object)
      : object(object), track(object.world_from_object), flat(isFlat(object.mesh)) {}

  WorldObject object;  // its mesh is rescaled by edits,
  double scale = 1.0;  // by so much in all
  ObservedTrack track;
  // 3 #V x K, object frame: in which it deforms in the video; empty: as a rigid body
  Eigen::MatrixXd modes;
  WindTrack wind;  // that its cloth shows in the video
  int id = 0;      // index among the actors; also its obstacle's id
  ObjectSettings settings;
  Material observed_material;  // with which the observed shape is at rest
  Material material;
  bool stiffness_given = false;  // by an edit, in Pa
  ObjectKind kind = ObjectKind::kStatic;
  std::optional<ObjectKind> forced_kind;
  std::string reason = "no edit touches it";
  bool edited = false, removed = false;
  bool altered = false;  // by an edit that does more than to let it go on, or of its look
  // as in the video, with the velocity it has there, and nothing else is edited
  bool continues = false;
  bool inserted = false;          // not in the video
  bool immovable = false;         // of infinite mass
  bool flat = false;              // without a mass: no rigid body can be made of it
  std::vector<int> own_supports;  // ids of the support meshes that are its own surface
  // Contacts of own supports that it has put an end to; others' wishes stay.
  std::vector<std::pair<std::string, std::string>> ended_contacts;
  std::string source;  // of a copy: the object of the video whose model it is drawn by
  Holder holder = Holder::kUnknown;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();   // m/s^2
  Eigen::Vector3d buoyancy = Eigen::Vector3d::Zero();  // m/s^2, as observed
  // By edits, from where the video has it; known anew with every change of its kind.
  Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
  std::optional<RigidWorld::Id> body;  // also as a collider while static
  std::unique_ptr<SoftObject> soft;
  Vec key_nodes;  // 3n, m: of one that deforms in the video, in the key frame
  std::unique_ptr<ObservedDrive>
      drive;  // of soft: what moves it in the video, until an edit's wind does
  Eigen::Isometry3d soft_from_object = Eigen::Isometry3d::Identity();  // pose when soft was made
  std::unique_ptr<SurfaceTree> tree;                                   // object frame
  std::vector<Pull> pulls;
  struct Sheet {
    bool closed = false;
    double areal_density = 0.0;  // kg/m^2
  };
  std::optional<Sheet> sheet;      // how the surface meets the air; made when it is needed
  WindTrack air;                   // around it, by edits
  std::vector<double> collisions;  // instants in the video, s, ascending
  Look look;
  std::vector<std::vector<int>> fixed;  // vertices per fixed region
  double pressure = 0.0;                // Pa, by an edit
  bool asleep = false;
  int calm_frames = 0;
  double soft_ms = 0.0;  // of the last frame
  std::string note;      // what the user should know about the model

  // Buoyancy is a force: it stays the same when an edit changes the mass.
  Eigen::Vector3d acceleration() const {
    return gravity + observed_material.density / material.density * buoyancy;
  }
  // Where the video has it; an edit may have given it another look.
  bool followsVideo() const {
    return !removed && kind == ObjectKind::kStatic &&
           placement.isApprox(Eigen::Isometry3d::Identity(), 1e-9);
  }
  bool simulated() const {
    return !removed && (kind == ObjectKind::kRigid || kind == ObjectKind::kDeformable);
  }
};

}  // namespace calipso::fem
