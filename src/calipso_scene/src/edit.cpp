#include "calipso_scene/edit.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace calipso {

namespace {

void require(bool holds, const char* field, double value, const char* range) {
  if (holds) return;
  std::ostringstream text;
  text << field << " = " << value << " is not allowed; it must be " << range;
  throw std::invalid_argument(text.str());
}

void requireFinite(const Eigen::Vector3d& value, const char* field) {
  for (int i = 0; i < 3; ++i) require(std::isfinite(value[i]), field, value[i], "finite");
}

bool concernsScene(EditKind kind) {
  switch (kind) {
    case EditKind::kGravity:
    case EditKind::kReset:
    case EditKind::kWind:
    case EditKind::kSpeedScale:
    case EditKind::kTimeScale:
    case EditKind::kLight:
    case EditKind::kInsert:
      return true;
    default:
      return false;
  }
}

void requireKnown(const std::string& name, const char* field,
                  const std::vector<std::string>& objects) {
  if (std::find(objects.begin(), objects.end(), name) != objects.end()) return;
  std::string known;
  for (const auto& object : objects) known += (known.empty() ? "" : ", ") + object;
  throw std::invalid_argument(std::string(field) + " is '" + name +
                              "', which is not in the scene; it has " + known);
}

void validateObject(const Edit& edit, const std::vector<std::string>& objects) {
  if (!edit.object.empty() || !concernsScene(edit.kind))
    requireKnown(edit.object, "object", objects);
  if (!edit.after.empty()) requireKnown(edit.after, "after", objects);
  require(edit.collision >= 1, "collision", edit.collision,
          "1 for the first, 2 for the second, ...");
}

// A share, or NaN for "unchanged".
void requireShare(double value, const char* field) {
  require(std::isnan(value) || (value >= 0.0 && value <= 1.0), field, value, "in [0, 1]");
}

void validateRegion(const Region& region) {
  require(region.pixel.allFinite(), "region.u/v", region.pixel[0], "finite");
  requireFinite(region.point, "region.point");
  requireFinite(region.box_min, "region.box_min");
  requireFinite(region.box_max, "region.box_max");
  require(std::isfinite(region.radius) && region.radius >= 0.0, "region.radius", region.radius,
          "finite and >= 0 m");
  if (region.kind != RegionKind::kBox) return;
  for (int i = 0; i < 3; ++i) {
    require(region.box_max[i] >= region.box_min[i], "region.box_max", region.box_max[i],
            "no less than region.box_min");
  }
}

// NaN stands for "unchanged" here.
void validateMaterial(const Edit& edit) {
  const bool factor = edit.mode == EditMode::kFactor;
  const auto positive = [&](double value, const char* field, const char* range) {
    require(std::isnan(value) || (std::isfinite(value) && value > 0.0), field, value, range);
  };
  positive(edit.youngs_modulus, "youngs_modulus", factor ? "a factor > 0" : "> 0 Pa");
  require(std::isnan(edit.density) || edit.density > 0.0, "density", edit.density,
          factor ? "a factor > 0; .inf: nothing moves it" : "> 0 kg/m^3; .inf: nothing moves it");
  require(
      std::isnan(edit.poissons_ratio) || (edit.poissons_ratio > -1.0 && edit.poissons_ratio < 0.5),
      "poissons_ratio", edit.poissons_ratio, "in (-1, 0.5)");
  require(std::isnan(edit.damping) || (std::isfinite(edit.damping) && edit.damping >= 0.0),
          "damping", edit.damping, "finite and >= 0 s");
}

void requireAnyChange(const Edit& edit) {
  if (std::isnan(edit.youngs_modulus) && std::isnan(edit.density) &&
      std::isnan(edit.poissons_ratio) && std::isnan(edit.damping)) {
    throw std::invalid_argument(
        "a material edit changes nothing; give youngs_modulus, poissons_ratio, density or damping");
  }
}

void validateContact(const Edit& edit) {
  require(std::isnan(edit.friction) || (std::isfinite(edit.friction) && edit.friction >= 0.0),
          "friction", edit.friction, "finite and >= 0");
  requireShare(edit.restitution, "restitution");
}

void validateLook(const Edit& edit) {
  for (int i = 0; i < 3; ++i)
    require(std::isnan(edit.color[i]) || (std::isfinite(edit.color[i]) && edit.color[i] >= 0.0),
            "color", edit.color[i], "finite and >= 0");
  requireShare(edit.specular, "specular");
  requireShare(edit.roughness, "roughness");
}

void validateScale(const Edit& edit) {
  const bool slower = edit.kind == EditKind::kTimeScale;
  if (slower && !edit.after.empty()) {
    throw std::invalid_argument("a time_scale edit cannot wait for a collision (after is '" +
                                edit.after +
                                "'): the video is laid out before it plays; give its time t");
  }
  // A slowed frame is sent 1 / factor times; one of a hastened scene is simulated factor times as
  // long, which nobody can follow by then.
  constexpr double kSlowest = 0.001, kFastest = 100.0;
  require(edit.factor > 0.0 && edit.factor <= (slower ? 1.0 : kFastest) &&
              (!slower || edit.factor >= kSlowest),
          "factor", edit.factor, slower ? "in [0.001, 1]" : "in (0, 100]");
}

void validateNewName(const Edit& edit, const std::vector<std::string>& objects) {
  if (edit.new_name.empty()) {
    throw std::invalid_argument("value is empty; give the new object's name");
  }
  if (std::find(objects.begin(), objects.end(), edit.new_name) != objects.end()) {
    throw std::invalid_argument(
        "value is '" + edit.new_name +
        "', which the scene has already; give the new object a name of its own");
  }
}

void validateInsert(const Edit& edit) {
  if (!edit.object.empty()) {
    throw std::invalid_argument(
        "object is '" + edit.object +
        "', but an insert is of the scene; leave it out and name the new object in value");
  }
  if (edit.model_path.empty())
    throw std::invalid_argument("model is empty; give the path of a CAD file");
}

}  // namespace

void validate(const Edit& edit, const std::vector<std::string>& objects) {
  validateObject(edit, objects);
  validateRegion(edit.region);
  require(std::isfinite(edit.time), "t", edit.time, "finite");
  requireFinite(edit.vector, "vector");
  requireFinite(edit.angular, "angular");
  requireFinite(edit.translation, "translation");
  require(edit.rotation.coeffs().allFinite(), "rotation", edit.rotation.w(), "finite");
  require(std::isfinite(edit.scale) && edit.scale > 0.0, "scale", edit.scale, "finite and > 0");
  require(std::isfinite(edit.factor), "factor", edit.factor, "finite");
  require(std::isfinite(edit.ramp) && edit.ramp >= 0.0, "ramp", edit.ramp, "finite and >= 0 s");
  require(std::isfinite(edit.duration) && edit.duration >= 0.0, "duration", edit.duration,
          "finite and >= 0 s");
  require(std::isfinite(edit.pressure), "pressure", edit.pressure, "finite");
  validateContact(edit);
  validateLook(edit);
  validateMaterial(edit);
  if (edit.kind == EditKind::kMaterial) requireAnyChange(edit);
  if (edit.kind == EditKind::kDuplicate || edit.kind == EditKind::kInsert)
    validateNewName(edit, objects);
  if (edit.kind == EditKind::kInsert) validateInsert(edit);
  if (edit.kind == EditKind::kSpeedScale || edit.kind == EditKind::kTimeScale) validateScale(edit);
  if (edit.kind == EditKind::kLight) require(edit.factor > 0.0, "factor", edit.factor, "> 0");
}

}  // namespace calipso
