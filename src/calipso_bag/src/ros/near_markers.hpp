#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <string>

namespace calipso::bag {

// rviz's view through a camera ends 100 m from it. Markers of which some lie near that or beyond
// are given again in the camera's frame, shrunk towards the camera until the farthest is 1 m away:
// through the camera they look the same, and in the 3D view they are too small to disturb. Without
// any so far away nothing is left but what clears. @param markers  in the world's frame
visualization_msgs::MarkerArray nearMarkers(const visualization_msgs::MarkerArray& markers,
                                            const Eigen::Isometry3d& camera_from_world,
                                            const std::string& camera_frame);

}  // namespace calipso::bag
