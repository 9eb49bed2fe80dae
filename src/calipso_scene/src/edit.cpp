#include "calipso_scene/edit.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "yaml_reading.hpp"

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

void validateObject(const Edit& edit, const std::vector<std::string>& objects) {
  const bool whole_scene = edit.kind == EditKind::kGravity || edit.kind == EditKind::kReset;
  if (edit.object.empty() && whole_scene) return;
  if (std::find(objects.begin(), objects.end(), edit.object) != objects.end()) return;
  std::string known;
  for (const auto& name : objects) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("object is '" + edit.object + "', which is not in the scene; it has " +
                              known);
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
  positive(edit.density, "density", factor ? "a factor > 0" : "> 0 kg/m^3");
  require(std::isnan(edit.poissons_ratio) ||
              (edit.poissons_ratio > -1.0 && edit.poissons_ratio < 0.5),
          "poissons_ratio", edit.poissons_ratio, "in (-1, 0.5)");
  require(std::isnan(edit.damping) || (std::isfinite(edit.damping) && edit.damping >= 0.0),
          "damping", edit.damping, "finite and >= 0 s");
  if (std::isnan(edit.youngs_modulus) && std::isnan(edit.density) &&
      std::isnan(edit.poissons_ratio) && std::isnan(edit.damping)) {
    throw std::invalid_argument(
        "a material edit changes nothing; give youngs_modulus, poissons_ratio, density or damping");
  }
}

const std::vector<std::string>& editKeys() {
  static const std::vector<std::string> keys = {
      "t",      "object", "kind",  "mode",           "region",         "vector",  "angular",
      "translation",      "rotation", "scale",       "factor",         "ramp",    "duration",
      "youngs_modulus",   "poissons_ratio",          "density",        "damping", "value"};
  return keys;
}

// A point of the surface is given in pixels of the key frame or in metres of the world.
Region readRegion(const YAML::Node& node, const YamlReader& reader) {
  reader.rejectUnknownKeys(node, {"kind", "u", "v", "point", "radius", "box_min", "box_max"});
  Region region;
  region.kind = regionKindFromString(reader.text(node, "kind", ""));
  region.radius = reader.number(node, "radius", 0.0);
  if (region.kind == RegionKind::kPixel) {
    region.pixel = {reader.number(node, "u"), reader.number(node, "v")};
  } else if (region.kind == RegionKind::kSphere) {
    region.point = reader.vector(node, "point", 3);
  } else if (region.kind == RegionKind::kBox) {
    region.box_min = reader.vector(node, "box_min", 3);
    region.box_max = reader.vector(node, "box_max", 3);
  }
  return region;
}

// [x, y, z, w], as in geometry_msgs/Quaternion.
Eigen::Quaterniond readRotation(const YAML::Node& node, const YamlReader& reader) {
  const Eigen::VectorXd q = reader.vector(node, "rotation", 4);
  if (q.norm() < 1e-6) reader.fail("rotation", "is zero; give a quaternion [x, y, z, w]");
  return Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized();
}

void readVectors(const YAML::Node& node, const YamlReader& reader, Edit& edit) {
  if (node["region"]) edit.region = readRegion(node["region"], reader);
  if (node["vector"]) edit.vector = reader.vector(node, "vector", 3);
  if (node["angular"]) edit.angular = reader.vector(node, "angular", 3);
  if (node["translation"]) edit.translation = reader.vector(node, "translation", 3);
  if (node["rotation"]) edit.rotation = readRotation(node, reader);
}

Edit readEdit(const YAML::Node& node, const YamlReader& reader) {
  if (!node.IsMap()) reader.fail("", "is not a map of key: value; see the tutorial for examples");
  reader.rejectUnknownKeys(node, editKeys());
  Edit edit;
  edit.time = reader.number(node, "t");
  if (edit.time < 0.0) reader.fail("t", "must be >= 0 s after the first frame");
  edit.object = reader.text(node, "object", "");
  edit.kind = editKindFromString(reader.text(node, "kind"));
  edit.mode = editModeFromString(reader.text(node, "mode", ""), edit.kind);
  readVectors(node, reader, edit);
  edit.scale = reader.number(node, "scale", edit.scale);
  edit.factor = reader.number(node, "factor", edit.factor);
  edit.ramp = reader.number(node, "ramp", edit.ramp);
  edit.duration = reader.number(node, "duration", edit.duration);
  edit.youngs_modulus = reader.number(node, "youngs_modulus", kUnchanged);
  edit.poissons_ratio = reader.number(node, "poissons_ratio", kUnchanged);
  edit.density = reader.number(node, "density", kUnchanged);
  edit.damping = reader.number(node, "damping", kUnchanged);
  if (edit.kind == EditKind::kObjectKind) {
    edit.object_kind = objectKindFromString(reader.text(node, "value"));
  }
  return edit;
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
  if (edit.kind == EditKind::kMaterial) validateMaterial(edit);
}

std::vector<Edit> loadEdits(const std::string& path, const std::vector<std::string>& objects) {
  const YAML::Node root = YamlReader::load(path);
  if (root.IsNull()) return {};
  if (!root.IsSequence()) {
    throw std::invalid_argument(path + ": is not a list of edits; start each edit with '- '");
  }
  std::vector<Edit> edits;
  for (std::size_t i = 0; i < root.size(); ++i) {
    const std::string entry = "edit " + std::to_string(i + 1);
    const YamlReader reader(path, entry);
    try {
      edits.push_back(readEdit(root[i], reader));
      validate(edits.back(), objects);
    } catch (const std::invalid_argument& error) {
      const std::string text = error.what();
      if (text.rfind(path, 0) == 0) throw;
      throw std::invalid_argument(path + ": " + entry + ": " + text);
    }
  }
  std::stable_sort(edits.begin(), edits.end(),
                   [](const Edit& a, const Edit& b) { return a.time < b.time; });
  return edits;
}

}  // namespace calipso
