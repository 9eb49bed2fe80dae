#pragma once

#include <ros/time.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>

#include "calipso_fem/world/world.hpp"

namespace calipso::fem {

struct MarkerStyle {
  std::string colour_by = "von_mises";  // or displacement
  double force_scale = 0.05;            // m per N
};

// Everything the simulator shows in rviz, one namespace per kind of thing: surface, volume grid,
// fixed nodes, forces, contacts, support. Frame: the world.
visualization_msgs::MarkerArray toMarkers(const World& world, const MarkerStyle& style,
                                          const ros::Time& stamp);

}  // namespace calipso::fem
