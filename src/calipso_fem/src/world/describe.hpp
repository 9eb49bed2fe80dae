#pragma once

#include <Eigen/Core>
#include <sstream>
#include <string>

namespace calipso::fem {

// "(1, 2, 3)", for messages.
inline std::string describe(const Eigen::Vector3d& v) {
  std::ostringstream text;
  text << "(" << v.x() << ", " << v.y() << ", " << v.z() << ")";
  return text.str();
}

}  // namespace calipso::fem
