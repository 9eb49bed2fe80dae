#include "calipso_ros/mode.hpp"

#include <stdexcept>

#include "calipso_ros/params.hpp"

namespace calipso {

Mode modeFromString(const std::string& text, const std::string& parameter) {
  if (text == "bag") return Mode::kBag;
  if (text == "live") return Mode::kLive;
  throw std::invalid_argument("parameter " + parameter + " is '" + text + "'; give bag or live");
}

Mode modeParam(const ros::NodeHandle& pnh) {
  const std::string name = "mode";
  return modeFromString(optionalParam<std::string>(pnh, name, "bag"), pnh.resolveName(name));
}

}  // namespace calipso
