#pragma once

#include <ros/node_handle.h>

#include <sstream>
#include <stdexcept>
#include <string>

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

// A path as the user writes it, made absolute: "~/" is the home folder, all others count from the
// folder in which roslaunch or rosrun was called, which nodes themselves do not run in.
std::string absolutePath(const std::string& path);

// The path of a parameter without which the node cannot run, absolute.
// @throw std::invalid_argument naming the parameter
std::string pathParam(const ros::NodeHandle& pnh, const std::string& name);
// Of one that may be left out: "" then, and where it is "none".
std::string optionalPathParam(const ros::NodeHandle& pnh, const std::string& name);

}  // namespace calipso
