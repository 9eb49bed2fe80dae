#include "calipso_render/visibility.hpp"

namespace calipso::render {

void Visibility::visibilities(const LightPoints& points, int count, float* visible) const {
  const auto at = [](const float* const(&axes)[3], int k) {
    return Eigen::Vector3f(axes[0][k], axes[1][k], axes[2][k]);
  };
  for (int k = 0; k < count; ++k)
    visible[k] = visibility(at(points.position, k), at(points.normal, k));
}

}  // namespace calipso::render
