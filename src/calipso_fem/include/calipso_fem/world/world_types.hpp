#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calipso_fem/fem_options.hpp"
#include "calipso_scene/edit.hpp"
#include "calipso_scene/material.hpp"
#include "calipso_scene/scene.hpp"
#include "calipso_scene/triangle_mesh.hpp"

// What goes into the simulated world and what comes out of it. SI units, world frame unless said.
namespace calipso::fem {

constexpr double kAirDrag = 1.2;  // kg/m^3: density of air times a flat plate's coefficient of drag

// An object as the alignment found it at the key frame.
struct WorldObject {
  std::string name;
  int index = 0;                                                        // label in masks
  TriangleMesh mesh;                                                    // object frame
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();  // at the key frame
  std::vector<AttachmentBox> attachments;
  bool in_video = true;  // no copy, and not inserted
};

struct SupportMesh {
  std::string name;
  TriangleMesh mesh;  // world frame
};

struct WorldScene {
  Camera camera;                                // at the key frame
  Eigen::Vector3d gravity = {0.0, 0.0, -9.81};  // m/s^2
  std::vector<SupportPlane> planes;
  std::vector<SupportMesh> support_meshes;
  std::vector<WorldObject> objects;
  std::string directory;  // from which the paths of edits start
};

// How an object moves in the video at one instant (calipso_msgs/ObjectDynamics).
struct ObservedMotion {
  double time = 0.0;  // s since the clip's first frame
  bool moving = false;
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();      // the point that moves with `linear`
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();        // m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();       // rad/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // m/s^2
  // Of a deforming object: amplitudes of its modes (m) from the shape in the key frame, and their
  // velocities (m/s).
  Eigen::VectorXd mode_amplitudes = {}, mode_velocities = {};
};

// How an object's look differs from the video's. NaN: unchanged.
struct Look {
  Eigen::Vector3d color = Eigen::Vector3d::Constant(kUnchanged);  // linear RGB
  bool absolute = false;  // color is the albedo; otherwise it multiplies it
  double specular = kUnchanged;
  double roughness = kUnchanged;

  bool changes() const {
    return color.allFinite() || !std::isnan(specular) || !std::isnan(roughness);
  }
};

// Where the sun stands for what is drawn.
struct Sun {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // towards it, world; zero: as in the video
  double factor = 1.0;                                  // of its brightness in the video
};

// How a surface takes part in contacts. A pair's value is the geometric mean of its two surfaces'.
struct SurfaceSettings {
  double friction = 0.5;
  double restitution = 0.3;       // 0..1
  double rolling_friction = 0.0;  // m
  double proximity = 0.0;         // m, minimal distance; 0: the world's. A pair takes the larger.
};

// What holds for one pair of surfaces instead of what follows from the two.
struct PairRule {
  bool contact = true;
  std::optional<double> friction, restitution;
  std::optional<double> proximity;  // m
};

// What the user may set per object. Empty: chosen automatically.
struct ObjectSettings {
  std::optional<double> youngs_modulus, poissons_ratio, density, damping;
  bool immovable() const { return density && std::isinf(*density); }
  std::optional<ObjectKind> kind;    // once an edit touches the object
  std::optional<double> cell_size;   // m
  std::optional<bool> self_contact;  // of a deformable one; empty: where it is thin enough to fold
  SurfaceSettings surface;
};

struct WorldParams {
  double frame_period = 1.0 / 30.0;  // s; steps are whole fractions of it
  double pixel_error = 0.5;          // px, discretisation error the resolution is chosen for
  int max_nodes = 1200;              // per deformable object
  int max_substeps = 2;              // of deformable objects, per frame
  int most_frames = 0;               // stepped at once at most, a longer gap is passed over; 0: all
  FemOptions fem;                    // cell_size and target_nodes are chosen per object
  double proximity = 0.0;  // m, minimal distance of surfaces; 0: a fiftieth of the smallest object
  int contact_iterations = 60;  // block Gauss-Seidel sweeps per solve
  // of the depth a step may end with: sweeps that change less are the last
  double contact_tolerance = 0.5;
  SurfaceSettings support;  // of planes and support meshes
  ObjectSettings defaults;
  std::map<std::string, ObjectSettings> objects;  // by object name; replaces the defaults

  const ObjectSettings& settingsOf(const std::string& object) const;
};

// @throw std::invalid_argument naming parameter, value and range
void validate(const WorldParams& params);
void validate(const SurfaceSettings& surface, const std::string& name);
void validate(const PairRule& rule, const std::string& name);

// One object at one instant.
struct ObjectSnapshot {
  std::string name;
  int index = 0;
  ObjectKind kind = ObjectKind::kStatic;
  bool edited = false;  // false: as in the video
  bool removed = false;
  bool sleeping = false;
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();  // best rigid motion
  // in the video, whatever became of it; none: not followed, it deforms, or the video has it not
  std::optional<Eigen::Isometry3d> observed;
  // #V x 3; empty unless edited
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> vertices;
  // #F x 3, of a model that the video does not have; else empty
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> triangles;
  Eigen::VectorXd von_mises;    // #V, Pa; empty unless deformable
  double kinetic_energy = 0.0;  // J
  double elastic_energy = 0.0;  // J
  std::string source;           // the object whose model this one is a copy of; empty: its own
  Look look;
};

struct ContactPoint {
  std::string a, b;  // b: an object or a support
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // from b towards a
  Eigen::Vector3d force = Eigen::Vector3d::Zero();    // on a, N
  double depth = 0.0;                                 // m, negative: a gap
  bool first_touch = false;  // the pair's first contact since they were last apart
};

// Two things have met that were apart.
struct TouchEvent {
  std::string a, b;   // b: an object or a support
  double time = 0.0;  // s since the first frame, finer than a frame
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // from b towards a
  double approach_speed = 0.0;                        // m/s, along the normal, positive
};

struct WorldState {
  double time = 0.0;  // s since the first frame
  std::vector<ObjectSnapshot> objects;
  std::vector<ContactPoint> contacts;
  std::vector<TouchEvent> first_touches;  // since the frame before, by time
  Sun sun;
  double step_ms = 0.0;
  int substeps = 0;
};

// How an object is modelled, and why.
struct PlanEntry {
  std::string object;
  ObjectKind kind = ObjectKind::kStatic;
  std::string reason;
  int nodes = 0;
  int elements = 0;
  std::string element, material_model, solver;
  double cell_size = 0.0;  // m
  double time_step = 0.0;  // s
  Material material;
  double mass = 0.0;  // kg
  double ms_per_frame = 0.0;
};

struct EditOutcome {
  Edit edit;
  double time = 0.0;  // s, of the frame with which it took effect or was refused
  bool accepted = false;
  std::string message;
};

}  // namespace calipso::fem
