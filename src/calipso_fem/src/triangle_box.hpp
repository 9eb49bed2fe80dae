#pragma once

#include <Eigen/Core>

namespace calipso::fem {

// Whether a triangle (columns: corners) meets the unit cube with its lowest corner at `low`, shrunk
// by `margin` on every side (grown where negative). Separating-axis test.
bool triangleMeetsUnitCube(const Eigen::Matrix3d& corners, const Eigen::Vector3d& low,
                           double margin);

}  // namespace calipso::fem
