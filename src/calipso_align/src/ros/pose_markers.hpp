#pragma once

#include <interactive_markers/interactive_marker_server.h>

#include <functional>
#include <string>

#include "calipso_scene/scene.hpp"
#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::align {

// One interactive marker per object: the stock model at its rough pose, to be dragged over the
// picture in rviz. Letting go of it calls back.
class PoseMarkers {
 public:
  // object: index into the scene's objects
  using OnMoved = std::function<void(int object, const Eigen::Isometry3d& world_from_object)>;

  PoseMarkers(const std::string& topic, OnMoved on_moved);
  void add(int object, const SceneObject& description, const TriangleMesh& model);
  void setPose(const std::string& name, const Eigen::Isometry3d& world_from_object);

 private:
  interactive_markers::InteractiveMarkerServer server_;
  OnMoved on_moved_;
};

}  // namespace calipso::align
