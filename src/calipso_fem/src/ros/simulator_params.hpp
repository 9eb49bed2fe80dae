#pragma once

#include <ros/node_handle.h>

#include <string>

#include "calipso_fem/world/world_types.hpp"
#include "calipso_ros/mode.hpp"

namespace calipso::fem {

// Parameters of simulator_node; config/simulator.yaml lists them with units.
struct SimulatorParams {
  std::string scene_directory;
  Mode mode = Mode::kBag;
  std::string colour_by = "von_mises";  // or displacement
  WorldParams world;
};

// @throw std::invalid_argument naming the parameter, its value and what is allowed
SimulatorParams loadSimulatorParams(const ros::NodeHandle& pnh);

}  // namespace calipso::fem
