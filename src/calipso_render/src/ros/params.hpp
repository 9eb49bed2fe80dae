#pragma once

#include <ros/ros.h>

#include "calipso_render/renderer.hpp"
#include "calipso_ros/mode.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {

struct NodeParams {
  Scene scene;
  Mode mode = Mode::kBag;
  RenderParams render;
  int clip_samples = 24;  // frames of the clip that are kept for the background, 2 .. 200
  int live_queue = 10;    // frames that wait for their state in live mode, 1 .. 1000
};

// Reads the private parameters; what the scene gives is filled into `render`.
// @throw std::invalid_argument naming parameter, value and range
NodeParams loadParams(const ros::NodeHandle& pnh);

}  // namespace calipso::render
