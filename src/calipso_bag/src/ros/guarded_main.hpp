#pragma once

#include <ros/ros.h>

#include <exception>
#include <functional>
#include <iostream>
#include <string>

#include "calipso_bag/launch_guard.hpp"

namespace calipso::bag {

// The main() of a node whose failure is the launch's failure: says what went wrong and makes
// roslaunch exit non-zero.
inline int runGuarded(const std::string& name, const std::function<void()>& body) {
  try {
    body();
    return 0;
  } catch (const std::exception& error) {
    if (ros::ok()) {
      ROS_FATAL_STREAM(name << ": " << error.what());
    } else {  // interrupted: ROS prints no more
      std::cerr << name << ": " << error.what() << std::endl;
    }
    failLaunch();
    return 1;
  }
}

// The main() of a command line tool.
inline int runTool(const std::function<void()>& body) {
  try {
    body();
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}

}  // namespace calipso::bag
