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

// "3.2 mm", "1.54 m", for messages.
inline std::string describeLength(double meters) {
  std::ostringstream text;
  text.precision(3);
  if (meters < 1.0)
    text << 1e3 * meters << " mm";
  else
    text << meters << " m";
  return text.str();
}

}  // namespace calipso::fem
