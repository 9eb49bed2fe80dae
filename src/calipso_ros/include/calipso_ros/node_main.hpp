#pragma once

#include <ros/ros.h>

#include <exception>
#include <sstream>
#include <stdexcept>
#include <string>

#include "calipso_ros/node_reporter.hpp"

namespace calipso {

// A parameter without which the node cannot run.
// @throw std::invalid_argument naming the parameter
template <typename T>
T requiredParam(const ros::NodeHandle& pnh, const std::string& name) {
  T value;
  if (!pnh.getParam(name, value)) {
    throw std::invalid_argument("parameter " + pnh.resolveName(name) + " is missing; set it");
  }
  return value;
}

// A parameter that may be left out.
// @throw std::invalid_argument naming one that is there and of another type
template <typename T>
T optionalParam(const ros::NodeHandle& pnh, const std::string& name, const T& otherwise) {
  T value = otherwise;
  XmlRpc::XmlRpcValue given;
  if (!pnh.getParam(name, value) && pnh.getParam(name, given)) {
    std::ostringstream text;
    text << "parameter " << pnh.resolveName(name) << " is " << given
         << ", of another type than its default; see the package's README and config for what it "
            "takes";
    throw std::invalid_argument(text.str());
  }
  return value;
}

// The main() of every node: init, construct Node(nh, pnh), spin. If construction throws, says so on
// the log and, for the player not to wait for it, as the status FAILED; returns 1.
template <typename Node>
int runNode(int argc, char** argv, const std::string& name) {
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
