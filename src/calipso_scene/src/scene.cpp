#include "calipso_scene/scene.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "yaml_reading.hpp"

namespace calipso {

namespace {

std::string existing(const std::string& path) {
  return std::filesystem::exists(path) ? path : std::string();
}

bool hasOneInteger(const std::string& pattern) {
  static const std::regex kOneInteger("[^%]*%(0?[1-9])?d[^%]*");
  return std::regex_match(pattern, kOneInteger);
}

// The lowest number after `gap` that a frame file has.
std::optional<int> frameAfter(const Scene& scene, int gap) {
  const std::string& pattern = scene.frame_pattern;
  const std::filesystem::path prefix(pattern.substr(0, pattern.find('%')));
  const std::string start = prefix.filename().string();
  std::optional<int> next;
  std::error_code none;  // no folder, no frames
  for (const auto& entry :
       std::filesystem::directory_iterator(scene.directory / prefix.parent_path(), none)) {
    const std::string name = entry.path().filename().string();
    if (name.compare(0, start.size(), start) != 0) continue;
    int k = 0;
    const char* const digits = name.data() + start.size();
    const auto parsed = std::from_chars(digits, name.data() + name.size(), k);
    if (parsed.ec == std::errc() && k > gap && k < next.value_or(k + 1) &&
        std::filesystem::exists(scene.framePath(k)))
      next = k;
  }
  return next;
}

int frameFiles(const Scene& scene, const YamlReader& reader) {
  int count = 0;
  while (std::filesystem::exists(scene.framePath(count))) ++count;
  if (const std::optional<int> next = frameAfter(scene, count))
    reader.fail("n_frames", "is missing, and so is " + scene.framePath(count) + ", though " +
                                numbered(scene.frame_pattern, *next) +
                                " is there; number the frames from 0 without a gap, or give "
                                "n_frames");
  return count;
}

Camera readCamera(const YAML::Node& root, const YamlReader& reader) {
  Camera camera;
  reader.positive(root, "width", "px");
  reader.positive(root, "height", "px");
  camera.width = reader.integer(root, "width");
  camera.height = reader.integer(root, "height");
  camera.fx = reader.positive(root, "fx", "px");
  camera.fy = reader.positive(root, "fy", "px");
  camera.cx = reader.number(root, "cx");
  camera.cy = reader.number(root, "cy");
  if (root["distortion"] && !reader.vector(root, "distortion", 5).isZero()) {
    reader.fail("distortion", "is not zero; undistort the images first (image_proc)");
  }
  camera.world_from_camera = reader.pose(root, "world_T_camera");
  return camera;
}

std::vector<Eigen::Isometry3d> readCameraPath(const YAML::Node& root, const YamlReader& reader) {
  std::vector<Eigen::Isometry3d> poses;
  for (const YAML::Node& entry : reader.list(root, "world_T_camera_per_frame")) {
    YAML::Node wrapped;
    wrapped["world_T_camera_per_frame"] = entry;
    poses.push_back(reader.pose(wrapped, "world_T_camera_per_frame"));
  }
  return poses;
}

void readSupport(const YAML::Node& root, const YamlReader& reader, Scene& scene) {
  for (const YAML::Node& entry : reader.list(root, "support")) {
    if (!entry.IsMap())
      reader.fail("support",
                  "has an entry that names neither; give \"plane: [nx, ny, nz, d]\" or "
                  "\"mesh: FILE\"");
    if (entry["mesh"]) {
      scene.support_meshes.push_back(scene.directory + "/" + reader.text(entry, "mesh"));
      continue;
    }
    const Eigen::VectorXd plane = reader.vector(entry, "plane", 4);
    const double length = plane.head<3>().norm();
    if (length < 1e-9) reader.fail("support.plane", "has a zero normal; give [nx, ny, nz, d]");
    SupportPlane support;
    support.name = reader.text(entry, "name", "support plane");
    support.normal = plane.head<3>() / length;
    support.offset = plane[3] / length;
    if (entry["x_range"]) support.x_range = reader.vector(entry, "x_range", 2);
    scene.planes.push_back(support);
  }
}

std::vector<AttachmentBox> readAttachments(const YAML::Node& hints, const std::string& object,
                                           const YamlReader& reader) {
  std::vector<AttachmentBox> attachments;
  for (const YAML::Node& box : reader.list(hints, object)) {
    attachments.push_back({reader.text(box, "name", "attachment"), reader.vector(box, "box_min", 3),
                           reader.vector(box, "box_max", 3)});
  }
  return attachments;
}

Eigen::Vector4i readRectangle(const YAML::Node& node, const YamlReader& reader,
                              const Camera& camera) {
  const Eigen::Vector4i rect = reader.vector(node, "rect_xywh", 4).cast<int>();
  const Eigen::Vector2i first = rect.head<2>(), size = rect.tail<2>();
  const Eigen::Vector2i picture(camera.width, camera.height);
  if (size.minCoeff() <= 0)
    reader.fail("rect_xywh", "has no area; draw a rectangle around the object");
  if ((first.array() >= picture.array()).any() || (first + size).minCoeff() <= 0) {
    std::ostringstream text;
    text << "is [" << rect.transpose() << "], outside of the picture of " << camera.width << "x"
         << camera.height << "; draw a rectangle around the object in the first frame";
    reader.fail("rect_xywh", text.str());
  }
  return rect;
}

SceneObject readObject(const YAML::Node& node, const YAML::Node& root, const std::string& file,
                       const Scene& scene) {
  SceneObject object;
  object.name = YamlReader(file, "objects").text(node, "name");
  const YamlReader reader(file, "object '" + object.name + "'");
  object.index = reader.integer(node, "index");
  if (object.index < 1 || object.index > 254) {
    reader.fail("index", "is " + std::to_string(object.index) + "; it must be in 1..254");
  }
  object.cad_path = scene.directory + "/" + reader.text(node, "cad");
  object.initial_world_from_object = reader.pose(node, "initial_world_T_object");
  object.rect = readRectangle(node, reader, scene.camera);
  const YAML::Node hints = root["attachment_hints"];
  if (hints && hints.IsMap())
    object.attachments = readAttachments(hints, object.name, YamlReader(file, "attachment_hints"));
  return object;
}

void readObjects(const YAML::Node& root, const std::string& file, Scene& scene) {
  const YamlReader reader(file, "");
  std::set<std::string> names;
  std::set<int> indices;
  for (const YAML::Node& node : reader.list(root, "objects")) {
    scene.objects.push_back(readObject(node, root, file, scene));
    const SceneObject& object = scene.objects.back();
    if (!names.insert(object.name).second) {
      reader.fail("objects", "has '" + object.name + "' twice; give each object its own name");
    }
    if (!indices.insert(object.index).second) {
      reader.fail("objects", "has index " + std::to_string(object.index) +
                                 " twice; give each object its own index");
    }
  }
  if (scene.objects.empty()) reader.fail("objects", "is empty; list at least one object");
  const YAML::Node hints = root["attachment_hints"];
  if (!hints || hints.IsNull()) return;
  if (!hints.IsMap())
    reader.fail("attachment_hints", "has no objects' names; give each a list of boxes");
  YamlReader(file, "attachment_hints").checkKeys(hints, {names.begin(), names.end()});
}

// Strokes have a name of their own at most.
std::string strokesPath(const YAML::Node& root, const YamlReader& reader,
                        const std::string& directory) {
  const std::string usual = "strokes.png";
  const YAML::Node strokes = root["strokes"];
  const std::string file =
      strokes && strokes.IsMap() ? reader.text(strokes, "file", usual.c_str()) : usual;
  const std::string path = existing(directory + "/" + file);
  if (path.empty() && file != usual)
    reader.fail("strokes", "names " + file + ", which is not there; correct it or leave it out");
  return path;
}

}  // namespace

std::string numbered(const std::string& pattern, int k) {
  if (!hasOneInteger(pattern))
    throw std::invalid_argument("frame pattern '" + pattern +
                                "' needs exactly one integer field, like frames/%06d.jpg");
  std::vector<char> text(pattern.size() + 32);
  std::snprintf(text.data(), text.size(), pattern.c_str(), k);
  return text.data();
}

std::string Scene::framePath(int k) const { return directory + "/" + numbered(frame_pattern, k); }

Camera Scene::cameraAt(int k) const {
  Camera at = camera;
  const auto& moving = world_from_camera_per_frame;
  if (!moving.empty()) at.world_from_camera = moving[std::min<std::size_t>(k, moving.size() - 1)];
  return at;
}

std::vector<SupportPlane> Scene::onlySupports() const {
  return support_meshes.empty() ? planes : std::vector<SupportPlane>();
}

const SceneObject& Scene::object(const std::string& wanted) const {
  std::string known;
  for (const auto& candidate : objects) {
    if (candidate.name == wanted) return candidate;
    known += (known.empty() ? "" : ", ") + candidate.name;
  }
  throw std::invalid_argument("object '" + wanted + "' is not in scene '" + name +
                              "'; it has: " + known);
}

Scene loadScene(const std::string& directory) {
  const std::string file = directory + "/scene.yaml";
  const YAML::Node root = YamlReader::load(file);
  const YamlReader reader(file, "");
  Scene scene;
  scene.directory = directory;
  scene.name = root["name"] ? reader.text(root, "name")
                            : std::filesystem::canonical(directory).filename().string();
  scene.fps = reader.positive(root, "fps", "Hz");
  scene.frame_pattern = reader.text(root, "frames", "frames/%06d.jpg");
  if (!hasOneInteger(scene.frame_pattern))
    reader.fail("frames", "is '" + scene.frame_pattern +
                              "'; it needs exactly one integer field, like frames/%06d.jpg");
  scene.frame_count =
      root["n_frames"] ? reader.integer(root, "n_frames") : frameFiles(scene, reader);
  scene.camera = readCamera(root, reader);
  scene.camera_moves = root["camera_moving"] && reader.yes(root, "camera_moving");
  scene.world_from_camera_per_frame = readCameraPath(root, reader);
  if (root["gravity"]) scene.gravity = reader.vector(root, "gravity", 3);
  readSupport(root, reader, scene);
  scene.strokes_path = strokesPath(root, reader, directory);
  scene.matte_path = existing(directory + "/matte.png");
  scene.depth_path = existing(directory + "/depth/000000.png");
  if (!scene.depth_path.empty()) scene.depth_scale = reader.number(root, "depth_scale_m");
  readObjects(root, file, scene);
  return scene;
}

}  // namespace calipso
