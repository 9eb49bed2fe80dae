#pragma once

#include <ros/time.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>

#include "calipso_fem/world/world.hpp"

namespace calipso::fem {

// Everything the simulator shows in rviz, one namespace per kind of thing: surface, volume grid,
// fixed nodes, forces, contacts, support; each as large as suits its object. Frame: the world.
// colour_by: what colours surfaces, von_mises or displacement
visualization_msgs::MarkerArray toMarkers(const World& world, const std::string& colour_by,
                                          const ros::Time& stamp);

}  // namespace calipso::fem
