#include "calipso_flow/wind_course.hpp"

#include <algorithm>

namespace calipso::flow {

double WindCourse::weight(size_t knot, double time) const {
  if (knot > 0 && time < knots[knot]) {
    return std::max(0.0, (time - knots[knot - 1]) / (knots[knot] - knots[knot - 1]));
  }
  if (knot + 1 < knots.size() && time > knots[knot]) {
    return std::max(0.0, (knots[knot + 1] - time) / (knots[knot + 1] - knots[knot]));
  }
  return 1.0;
}

Eigen::Vector3d WindCourse::at(double time) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < knots.size(); ++i) sum += weight(i, time) * wind[i];
  return sum;
}

}  // namespace calipso::flow
