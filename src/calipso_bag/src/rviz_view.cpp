#include "calipso_bag/rviz_view.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace calipso::bag {
namespace {

constexpr double kBesideRad = 0.35, kAboveRad = 0.25;  // from the camera's view
constexpr double kLowestRad = 0.1, kHighestRad = 1.4;  // pitch: neither from below nor turned over
constexpr double kDistance = 3.1;  // of the objects' radius; rviz sees 45 degrees
constexpr double kNearest = 0.01;  // of the distance
constexpr double kAxes = 0.3;      // of the objects' radius

bool isSeen(const Camera& camera, const Eigen::Vector3d& p_world) {
  if ((camera.world_from_camera.inverse() * p_world).z() <= 0.0) return false;
  const Eigen::Vector2d pixel = camera.projectWorld(p_world);
  return pixel.x() >= 0.0 && pixel.x() < camera.width && pixel.y() >= 0.0 &&
         pixel.y() < camera.height;
}

// 1, 2 or 5 times a power of ten, about a fifth of the radius.
double gridCell(double radius) {
  const double wanted = 0.2 * radius, decade = std::pow(10.0, std::floor(std::log10(wanted)));
  for (const double step : {5.0, 2.0})
    if (step * decade <= wanted) return step * decade;
  return decade;
}

// Beneath the objects, its lines at whole cells.
void placeGrid(const Eigen::AlignedBox3d& bounds, double cell, YAML::Node grid) {
  grid["Cell Size"] = cell;
  grid["Offset"]["X"] = cell * std::round(bounds.center().x() / cell);
  grid["Offset"]["Y"] = cell * std::round(bounds.center().y() / cell);
  grid["Offset"]["Z"] = bounds.min().z();
}

void setView(const OrbitView& view, YAML::Node node) {
  node["Distance"] = view.distance;
  node["Focal Point"]["X"] = view.middle.x();
  node["Focal Point"]["Y"] = view.middle.y();
  node["Focal Point"]["Z"] = view.middle.z();
  node["Yaw"] = view.yaw;
  node["Pitch"] = view.pitch;
  node["Near Clip Distance"] = kNearest * view.distance;
}

}  // namespace

Eigen::AlignedBox3d objectBounds(const Scene& scene) {
  Eigen::AlignedBox3d bounds;
  for (const SceneObject& object : scene.objects) {
    const TriangleMesh mesh = loadMesh(object.cad_path);
    Eigen::AlignedBox3d box;
    for (int i = 0; i < mesh.vertexCount(); ++i)
      box.extend(object.initial_world_from_object * mesh.vertex(i));
    bounds.extend(box);
    for (const SupportPlane& plane : scene.planes) {
      const double height = plane.normal.dot(box.center()) - plane.offset;
      const Eigen::Vector3d foot = box.center() - height * plane.normal;
      if (height > 0.0 && isSeen(scene.camera, foot)) bounds.extend(foot);
    }
  }
  return bounds;
}

OrbitView orbitView(const Eigen::AlignedBox3d& bounds, const Eigen::Isometry3d& world_from_camera) {
  const Eigen::Vector3d back = -world_from_camera.linear().col(2);
  OrbitView view;
  view.middle = bounds.center();
  view.distance = kDistance * 0.5 * bounds.diagonal().norm();
  view.yaw = std::atan2(back.y(), back.x()) + kBesideRad;
  view.pitch =
      std::clamp(std::asin(std::clamp(back.z(), -1.0, 1.0)) + kAboveRad, kLowestRad, kHighestRad);
  return view;
}

std::string rvizConfigFor(const Scene& scene, const std::string& config) {
  YAML::Node root = YAML::Load(config);
  YAML::Node manager = root["Visualization Manager"];
  if (!manager || !manager["Views"] || !manager["Views"]["Current"])
    throw std::runtime_error("the configuration has no view");
  const Eigen::AlignedBox3d bounds = objectBounds(scene);
  if (bounds.isEmpty()) return config;
  const double radius = 0.5 * bounds.diagonal().norm();
  setView(orbitView(bounds, scene.camera.world_from_camera), manager["Views"]["Current"]);
  for (YAML::Node display : manager["Displays"]) {
    const auto kind = display["Class"].as<std::string>();
    if (kind == "rviz/Grid") placeGrid(bounds, gridCell(radius), display);
    if (kind == "rviz/TF") display["Marker Scale"] = kAxes * radius;
  }
  YAML::Emitter out;
  out << root;
  return out.c_str();
}

}  // namespace calipso::bag
