#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "calipso_scene/camera.hpp"
#include "calipso_scene/triangle_mesh.hpp"

namespace calipso {

// A plane n.x = d (unit normal, world frame, pointing to the free side) that holds objects up.
struct SupportPlane {
  std::string name;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0.0;                     // d, m
  std::optional<Eigen::Vector2d> x_range;  // m, world x; the plane ends there
};

// A box in the world in which an object is attached to its surroundings.
struct AttachmentBox {
  std::string name;
  Eigen::Vector3d min, max;  // world, m
};

struct SceneObject {
  std::string name;
  int index = 0;         // label in strokes.png and in masks, 1..254
  std::string cad_path;  // absolute
  Eigen::Isometry3d initial_world_from_object = Eigen::Isometry3d::Identity();  // rough placement
  Eigen::Vector4i rect = Eigen::Vector4i::Zero();  // x, y, width, height, px
  std::vector<AttachmentBox> attachments;
};

// What a user gives about a clip (scene.yaml): camera, gravity, supports, objects. Reads nothing
// else of a scene folder: a folder without its ground truth gives the same Scene.
struct Scene {
  std::string name;  // the folder's where scene.yaml names none
  std::string directory;
  double fps = 0.0;
  int frame_count = 0;        // the files there are where scene.yaml has no n_frames
  std::string frame_pattern;  // printf style, relative to directory
  Camera camera;              // pose: frame 0
  bool camera_moves = false;  // as scene.yaml says, also where it has no poses per frame
  std::vector<Eigen::Isometry3d> world_from_camera_per_frame;  // may be empty
  Eigen::Vector3d gravity = {0.0, 0.0, -9.81};                 // m/s^2, world
  std::vector<SupportPlane> planes;
  std::vector<std::string> support_meshes;  // absolute paths, world frame
  std::string strokes_path;                 // empty when there are none
  std::string matte_path;      // frame 0: white stays before edited objects; empty: none
  std::string depth_path;      // frame 0, 16 bit; empty when there is none
  double depth_scale = 0.001;  // m per unit of the depth image
  std::vector<SceneObject> objects;

  std::string framePath(int k) const;

  // The camera as it stands at frame k; past the last pose it stays there.
  Camera cameraAt(int k) const;

  // The planes, where they are all that objects stand on; none where a mesh holds objects up, too.
  std::vector<SupportPlane> onlySupports() const;

  // @throw std::invalid_argument naming the object asked for and the ones there are
  const SceneObject& object(const std::string& name) const;
};

// "frames/%06d.jpg", 7 -> "frames/000007.jpg".
// @throw std::invalid_argument unless the pattern has exactly one integer field
std::string numbered(const std::string& pattern, int k);

// @throw std::runtime_error / std::invalid_argument naming file, key, value and remedy
Scene loadScene(const std::string& directory);

}  // namespace calipso
