#include "calipso_ros/params.hpp"

#include <cstdlib>

namespace calipso {
namespace {

std::string folderIn(const char* variable) {
  const char* folder = std::getenv(variable);
  return folder != nullptr ? std::string(folder) + "/" : std::string();
}

}  // namespace

std::string absolutePath(const std::string& path) {
  if (path.compare(0, 1, "/") == 0) return path;
  if (path.compare(0, 2, "~/") == 0) return folderIn("HOME") + path.substr(2);
  return folderIn("PWD") + path;
}

std::string pathParam(const ros::NodeHandle& pnh, const std::string& name) {
  return absolutePath(requiredParam<std::string>(pnh, name));
}

std::string optionalPathParam(const ros::NodeHandle& pnh, const std::string& name) {
  const std::string path = optionalParam<std::string>(pnh, name, "");
  return path.empty() || path == "none" ? "" : absolutePath(path);
}

}  // namespace calipso
