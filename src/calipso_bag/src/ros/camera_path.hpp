#pragma once

#include <geometry_msgs/TransformStamped.h>

#include <string>
#include <vector>

#include "bag_clip.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::bag {

enum class PoseSource { kAuto, kBag, kScene };

// @throw std::invalid_argument naming the value and the ones allowed
PoseSource poseSourceFromString(const std::string& name);

// The camera's pose in the world at every frame.
struct CameraPath {
  std::vector<geometry_msgs::TransformStamped> world_from_camera;  // one per frame, at its stamp
  std::string origin;                                              // where it comes from, in words
};

// Poses from the bag's tf, or from scene.yaml. kAuto: from the bag if it has any tf.
// @throw std::runtime_error when a frame has no pose, saying which and what to do
CameraPath cameraPath(BagClip& clip, const Scene& scene, PoseSource source);

}  // namespace calipso::bag
