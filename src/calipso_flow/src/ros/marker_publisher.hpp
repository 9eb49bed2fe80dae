#pragma once

#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <vector>

#include "calipso_flow/clip_dynamics.hpp"

namespace calipso::flow {

// Shows the estimated motion in rviz: tracks, trajectory, velocity, instants of collision.
class MarkerPublisher {
 public:
  explicit MarkerPublisher(ros::NodeHandle& nh);

  // Keeps the clip's result, from which the markers of single frames are made.
  void keep(std::vector<ObjectDynamics> objects) { objects_ = std::move(objects); }

  // Publishes the markers of the clip's frame `index`; does nothing when nobody listens.
  void publish(size_t index, const ros::Time& stamp) const;

 private:
  ros::Publisher publisher_;
  std::vector<ObjectDynamics> objects_;
};

// All markers of one object at one frame.
visualization_msgs::MarkerArray markersOf(const ObjectDynamics& object, size_t index,
                                          const std_msgs::Header& header);

}  // namespace calipso::flow
