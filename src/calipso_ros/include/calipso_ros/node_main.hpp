#pragma once

#include <ros/ros.h>

#include <exception>
#include <string>

#include "calipso_ros/node_reporter.hpp"
#include "calipso_ros/params.hpp"
#include "calipso_scene/memory.hpp"

namespace calipso {

// The main() of every node of the graph: init, construct Node(nh, pnh), spin. If construction throws, says so on
// the log and, for the player not to wait for it, as the status FAILED; returns 1.
template <typename Node>
int runNode(int argc, char** argv, const std::string& name) {
  keepFreedMemory();
  ros::init(argc, argv, name);
  ros::NodeHandle nh;
  ros::NodeHandle pnh("~");
  try {
    Node node(nh, pnh);
    ros::spin();
    return 0;
  } catch (const std::exception& error) {
    NodeReporter(nh, name).lastWords(error.what());
    return 1;
  }
}

}  // namespace calipso
