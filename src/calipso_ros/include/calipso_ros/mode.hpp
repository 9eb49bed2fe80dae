#pragma once

#include <ros/node_handle.h>

#include <string>

namespace calipso {

// Where frames come from: a bag's player, which waits for the nodes, or a camera, which does not.
enum class Mode { kBag, kLive };

// @param parameter  the name of what gives it, for the message
// @throw std::invalid_argument naming the parameter, its value and what it takes
Mode modeFromString(const std::string& text, const std::string& parameter);

// The private parameter `mode`; of a bag unless given.
// @throw std::invalid_argument as above
Mode modeParam(const ros::NodeHandle& pnh);

}  // namespace calipso
