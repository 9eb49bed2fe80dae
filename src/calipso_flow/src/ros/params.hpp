#pragma once

#include <ros/ros.h>

#include <string>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_flow/dense_flow.hpp"
#include "calipso_ros/mode.hpp"

namespace calipso::flow {

// The node's parameters; config/flow.yaml explains each.
struct Params {
  std::string scene;  // directory
  Mode mode = Mode::kBag;
  DenseFlow::Preset flow_preset = DenseFlow::Preset::kUltrafast;
  DynamicsParams dynamics;
};

// @throw std::invalid_argument naming the parameter, its value and the allowed range
Params loadParams(const ros::NodeHandle& pnh);

}  // namespace calipso::flow
