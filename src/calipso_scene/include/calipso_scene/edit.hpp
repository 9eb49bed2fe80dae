#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <string>
#include <vector>

namespace calipso {

constexpr double kUnchanged = std::numeric_limits<double>::quiet_NaN();

enum class RegionKind { kAll, kPixel, kSphere, kBox };

// A part of an object's surface, chosen at the key frame. Fields as in calipso_msgs/Region.
struct Region {
  RegionKind kind = RegionKind::kAll;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();    // px
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    // world, m
  double radius = 0.0;                                // m; 0: a tenth of the object's diagonal
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();  // world, m
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();  // world, m
};

enum class EditKind {
  kTransform,
  kPull,
  kFix,
  kRelease,
  kMaterial,
  kGravity,
  kVelocity,
  kObjectKind,
  kRemove,
  kReset,
  kDuplicate,
  kInsert,
  kContact,
  kWind,
  kPressure,
  kTwist,
  kSpeedScale,
  kTimeScale,
  kAppearance,
  kLight
};
enum class EditMode { kForce, kTarget, kAbsolute, kFactor, kAdd, kEstimated };
enum class ObjectKind { kStatic, kKinematic, kRigid, kDeformable };

// One edit. Which fields are read depends on kind; see calipso_msgs/Edit for their meaning.
struct Edit {
  double time = 0.0;   // s since the clip's first frame; < 0: with the next frame
  std::string object;  // empty: the scene, or every object
  EditKind kind = EditKind::kReset;
  EditMode mode = EditMode::kAbsolute;
  Region region;
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  double scale = 1.0;
  double factor = 1.0;
  double ramp = 0.0;      // s
  double duration = 0.0;  // s; 0: until released
  double youngs_modulus = kUnchanged;
  double poissons_ratio = kUnchanged;
  double density = kUnchanged;
  double damping = kUnchanged;
  ObjectKind object_kind = ObjectKind::kStatic;
  std::string new_name;    // duplicate, insert: the new object's
  std::string model_path;  // insert: a CAD file
  std::string other;       // contact: the other object or support; empty: everything
  bool meet = true;        // contact: include (true) or exclude
  double friction = kUnchanged;
  double restitution = kUnchanged;
  double pressure = 0.0;                                          // Pa, inwards when > 0
  Eigen::Vector3d color = Eigen::Vector3d::Constant(kUnchanged);  // linear RGB
  double specular = kUnchanged;
  double roughness = kUnchanged;
  std::string after;  // not empty: `time` counts from a collision of this object
  int collision = 1;  // its first, second, ... in the video
};

// Names as they stand in YAML and in messages. The parsing direction throws std::invalid_argument
// naming the value and the ones allowed.
std::string toString(EditKind kind);
std::string toString(EditMode mode);
std::string toString(ObjectKind kind);
std::string toString(RegionKind kind);
EditKind editKindFromString(const std::string& name);
EditMode editModeFromString(const std::string& name, EditKind kind);  // empty: the kind's default
ObjectKind objectKindFromString(const std::string& name);
RegionKind regionKindFromString(const std::string& name);
bool meetFromString(const std::string& name);  // include (or empty): true; exclude: false

// Checks one edit's fields against their ranges and `objects` (the scene's names).
// @throw std::invalid_argument naming field, value and range
void validate(const Edit& edit, const std::vector<std::string>& objects);

// Reads a YAML list of edits; the empty list is valid. Keys: those of calipso_msgs/Edit, with `t`
// (s since the first frame) for the stamp. Sorted by time, file order kept among equals.
// @throw std::invalid_argument naming file, entry, key, value and remedy
std::vector<Edit> loadEdits(const std::string& path, const std::vector<std::string>& objects);

}  // namespace calipso
