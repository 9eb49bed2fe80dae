#include <algorithm>
#include <stdexcept>

#include "calipso_scene/edit.hpp"
#include "yaml_reading.hpp"

namespace calipso {

namespace {

const std::vector<std::string>& editKeys() {
  static const std::vector<std::string> keys = {
      "t",        "object",         "kind",           "mode",        "region",   "vector",
      "angular",  "translation",    "rotation",       "scale",       "factor",   "ramp",
      "duration", "youngs_modulus", "poissons_ratio", "density",     "damping",  "value",
      "model",    "other",          "friction",       "restitution", "pressure", "color",
      "specular", "roughness",      "after",          "collision"};
  return keys;
}

// A point of the surface is given in pixels of the key frame or in metres of the world.
Region readRegion(const YAML::Node& node, const YamlReader& reader) {
  reader.checkKeys(node, {"kind", "u", "v", "point", "radius", "box_min", "box_max"});
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
  if (node["color"]) edit.color = reader.vector(node, "color", 3);
}

Edit readEdit(const YAML::Node& node, const YamlReader& reader) {
  if (!node.IsMap()) reader.fail("", "is not a map of key: value; see the tutorial for examples");
  reader.checkKeys(node, editKeys());
  Edit edit;
  edit.time = reader.number(node, "t");
  if (edit.time < 0.0) {
    reader.fail("t", "is " + node["t"].Scalar() + "; it must be >= 0 s after the first frame");
  }
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
  if (node["density"]) edit.density = reader.numberOrInfinity(node, "density");  // nothing moves it
  edit.damping = reader.number(node, "damping", kUnchanged);
  edit.pressure = reader.number(node, "pressure", edit.pressure);
  edit.specular = reader.number(node, "specular", kUnchanged);
  edit.roughness = reader.number(node, "roughness", kUnchanged);
  edit.after = reader.text(node, "after", "");
  if (node["collision"]) edit.collision = reader.integer(node, "collision");
  if (edit.kind == EditKind::kObjectKind) {
    edit.object_kind = objectKindFromString(reader.text(node, "value"));
  }
  if (edit.kind == EditKind::kDuplicate || edit.kind == EditKind::kInsert)
    edit.new_name = reader.text(node, "value");
  if (edit.kind == EditKind::kInsert) edit.model_path = reader.text(node, "model");
  edit.other = reader.text(node, "other", "");
  edit.friction = reader.number(node, "friction", kUnchanged);
  edit.restitution = reader.number(node, "restitution", kUnchanged);
  if (edit.kind == EditKind::kContact) edit.meet = meetFromString(reader.text(node, "value", ""));
  return edit;
}

}  // namespace

std::vector<Edit> loadEdits(const std::string& path, const std::vector<std::string>& objects) {
  const YAML::Node root = YamlReader::load(path);
  if (root.IsNull()) return {};
  if (!root.IsSequence()) {
    throw std::invalid_argument(path + ": is not a list of edits; start each edit with '- '");
  }
  std::vector<Edit> edits;
  std::vector<std::string> known = objects;
  for (std::size_t i = 0; i < root.size(); ++i) {
    const std::string entry = "edit " + std::to_string(i + 1);
    const YamlReader reader(path, entry);
    try {
      edits.push_back(readEdit(root[i], reader));
      validate(edits.back(), known);
      if (!edits.back().new_name.empty()) known.push_back(edits.back().new_name);
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
