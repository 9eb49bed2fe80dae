#include <stdexcept>
#include <string>
#include <utility>

#include "calipso_scene/edit.hpp"

namespace calipso {

namespace {

template <typename Enum, std::size_t N>
using Names = std::pair<Enum, const char*>[N];

constexpr Names<EditKind, 20> kEditKinds = {{EditKind::kTransform, "transform"},
                                            {EditKind::kPull, "pull"},
                                            {EditKind::kFix, "fix"},
                                            {EditKind::kRelease, "release"},
                                            {EditKind::kMaterial, "material"},
                                            {EditKind::kGravity, "gravity"},
                                            {EditKind::kVelocity, "velocity"},
                                            {EditKind::kObjectKind, "kind"},
                                            {EditKind::kRemove, "remove"},
                                            {EditKind::kReset, "reset"},
                                            {EditKind::kDuplicate, "duplicate"},
                                            {EditKind::kInsert, "insert"},
                                            {EditKind::kContact, "contact"},
                                            {EditKind::kWind, "wind"},
                                            {EditKind::kPressure, "pressure"},
                                            {EditKind::kTwist, "twist"},
                                            {EditKind::kSpeedScale, "speed_scale"},
                                            {EditKind::kTimeScale, "time_scale"},
                                            {EditKind::kAppearance, "appearance"},
                                            {EditKind::kLight, "light"}};

constexpr Names<EditMode, 6> kEditModes = {
    {EditMode::kForce, "force"},       {EditMode::kTarget, "target"},
    {EditMode::kAbsolute, "absolute"}, {EditMode::kFactor, "factor"},
    {EditMode::kAdd, "add"},           {EditMode::kEstimated, "estimated"}};

constexpr Names<ObjectKind, 4> kObjectKinds = {{ObjectKind::kStatic, "static"},
                                               {ObjectKind::kKinematic, "kinematic"},
                                               {ObjectKind::kRigid, "rigid"},
                                               {ObjectKind::kDeformable, "deformable"}};

constexpr Names<RegionKind, 4> kRegionKinds = {{RegionKind::kAll, "all"},
                                               {RegionKind::kPixel, "pixel"},
                                               {RegionKind::kSphere, "sphere"},
                                               {RegionKind::kBox, "box"}};

template <typename Enum, std::size_t N>
std::string nameOf(Enum value, const Names<Enum, N>& names) {
  for (const auto& [candidate, name] : names) {
    if (candidate == value) return name;
  }
  throw std::logic_error("an enumerator without a name");
}

template <typename Enum, std::size_t N>
Enum valueOf(const std::string& text, const char* what, const Names<Enum, N>& names) {
  std::string known;
  for (const auto& [candidate, name] : names) {
    if (text == name) return candidate;
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  throw std::invalid_argument(std::string(what) + " is '" + text + "'; it must be one of " + known);
}

EditMode defaultMode(EditKind kind) {
  const bool force = kind == EditKind::kPull || kind == EditKind::kTwist;
  return force ? EditMode::kForce : EditMode::kAbsolute;
}

bool allows(EditKind kind, EditMode mode) {
  switch (kind) {
    case EditKind::kPull:
    case EditKind::kTwist:
      return mode == EditMode::kForce || mode == EditMode::kTarget;
    case EditKind::kGravity:
      return mode == EditMode::kAbsolute || mode == EditMode::kFactor ||
             mode == EditMode::kEstimated;
    case EditKind::kMaterial:
    case EditKind::kAppearance:
      return mode == EditMode::kAbsolute || mode == EditMode::kFactor;
    case EditKind::kWind:
      return mode == EditMode::kAbsolute || mode == EditMode::kEstimated;
    case EditKind::kVelocity:
      return mode == EditMode::kAbsolute || mode == EditMode::kAdd || mode == EditMode::kEstimated;
    default:
      return mode == EditMode::kAbsolute;
  }
}

}  // namespace

std::string toString(EditKind kind) { return nameOf(kind, kEditKinds); }
std::string toString(EditMode mode) { return nameOf(mode, kEditModes); }
std::string toString(ObjectKind kind) { return nameOf(kind, kObjectKinds); }
std::string toString(RegionKind kind) { return nameOf(kind, kRegionKinds); }

EditKind editKindFromString(const std::string& name) { return valueOf(name, "kind", kEditKinds); }

EditMode editModeFromString(const std::string& name, EditKind kind) {
  if (name.empty()) return defaultMode(kind);
  const EditMode mode = valueOf(name, "mode", kEditModes);
  if (!allows(kind, mode)) {
    std::string known;
    for (const auto& [candidate, text] : kEditModes) {
      if (allows(kind, candidate)) known += (known.empty() ? "" : ", ") + std::string(text);
    }
    throw std::invalid_argument("mode is '" + name + "'; for kind '" + toString(kind) +
                                "' it must be one of " + known);
  }
  return mode;
}

ObjectKind objectKindFromString(const std::string& name) {
  return valueOf(name, "value", kObjectKinds);
}

bool meetFromString(const std::string& name) {
  if (name.empty() || name == "include") return true;
  if (name == "exclude") return false;
  throw std::invalid_argument("value is '" + name + "'; it must be one of include, exclude");
}

RegionKind regionKindFromString(const std::string& name) {
  return name.empty() ? RegionKind::kAll : valueOf(name, "region.kind", kRegionKinds);
}

}  // namespace calipso
