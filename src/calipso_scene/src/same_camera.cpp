#include "calipso_scene/same_camera.hpp"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

namespace calipso {
namespace {

// How far apart two cameras see what `one` sees in its picture's corners, so far before it; px.
double cornersApart(const Camera& one, const Camera& other, double distance) {
  double apart = 0.0;
  for (const double u : {0.0, one.width - 1.0}) {
    for (const double v : {0.0, one.height - 1.0}) {
      const Eigen::Vector3d x = one.world_from_camera * (distance * one.ray(u, v));
      const bool seen = (other.world_from_camera.inverse() * x).z() > 0.0;
      apart = std::max(apart, seen ? (other.projectWorld(x) - Eigen::Vector2d(u, v)).norm()
                                   : std::numeric_limits<double>::infinity());
    }
  }
  return apart;
}

std::string size(const Camera& camera) {
  return std::to_string(camera.width) + "x" + std::to_string(camera.height);
}

std::string calibration(const Camera& camera) {
  std::ostringstream text;
  text << camera.fx << ", " << camera.fy << ", " << camera.cx << ", " << camera.cy;
  return text.str();
}

std::string position(const Camera& camera) {
  std::ostringstream text;
  const Eigen::IOFormat in_one_line(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", ", ");
  text << "(" << camera.world_from_camera.translation().format(in_one_line) << ") m";
  return text.str();
}

std::string pixels(double apart) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(0) << apart << " px";
  return text.str();
}

}  // namespace

void checkSameCamera(const Scene& scene, const Camera& video) {
  constexpr double kVisiblePx = 2.0;
  if (video.width != scene.camera.width || video.height != scene.camera.height) {
    throw std::runtime_error("images are " + size(video) + ", but scene.yaml is for " +
                             size(scene.camera) + "; use the scene of this video");
  }
  Camera calibrated = video;
  calibrated.world_from_camera = scene.camera.world_from_camera;
  if (const double apart = cornersApart(scene.camera, calibrated, 1.0); apart > kVisiblePx) {
    throw std::runtime_error("camera_info has fx, fy, cx, cy = " + calibration(video) +
                             ", scene.yaml has " + calibration(scene.camera) + ": " +
                             pixels(apart) +
                             " apart in the picture's corners; give both the camera's calibration");
  }
  for (const SceneObject& object : scene.objects) {
    const Eigen::Vector3d place = object.initial_world_from_object.translation();
    const double distance = (calibrated.world_from_camera.inverse() * place).z();
    if (distance <= 0.0) continue;  // the alignment refuses it by name
    const double apart = cornersApart(calibrated, video, distance);
    if (apart <= kVisiblePx) continue;
    throw std::runtime_error("tf has the first frame's camera at " + position(video) +
                             ", world_T_camera of scene.yaml at " + position(scene.camera) + ", " +
                             pixels(apart) + " apart in the picture's corners as far away as '" +
                             object.name +
                             "'; write tf's pose there, or have scene.yaml's published "
                             "(edit.launch: poses:=scene, live.launch: camera_pose:=true)");
  }
}

}  // namespace calipso
