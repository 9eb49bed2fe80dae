#pragma once

#include <calipso_msgs/Edit.h>
#include <ros/time.h>

#include <string>
#include <vector>

#include "calipso_scene/scene.hpp"

namespace calipso::bag {

// The edits of a YAML file, or those that an edited bag says were applied; none for "".
// Sorted by stamp. `first_stamp`: of the clip.
// @throw std::runtime_error / std::invalid_argument naming file, entry, value and remedy
std::vector<calipso_msgs::Edit> readEdits(const std::string& path, const Scene& scene,
                                          const ros::Time& first_stamp);

}  // namespace calipso::bag
