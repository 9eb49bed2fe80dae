#include "place/plane_view.hpp"

#include <limits>

namespace calipso::render {

PlaneView::PlaneView(const std::vector<SupportPlane>& planes, const Camera& camera) {
  const Eigen::Matrix3d R = camera.world_from_camera.linear();
  const Eigen::Vector3d eye = camera.world_from_camera.translation();
  eye_ = eye.cast<float>();
  ray_0_ = (R * camera.ray(0.0, 0.0)).cast<float>();
  ray_u_ = (R.col(0) / camera.fx).cast<float>();
  ray_v_ = (R.col(1) / camera.fy).cast<float>();
  constexpr float kNoLimit = std::numeric_limits<float>::max();
  for (const SupportPlane& p : planes) {
    Plane plane{p.normal.cast<float>(),
                static_cast<float>(p.offset - p.normal.dot(eye)),
                -kNoLimit,
                kNoLimit,
                0.0f,
                0.0f,
                0.0f,
                false};
    plane.slope_0 = plane.normal.dot(ray_0_), plane.slope_u = plane.normal.dot(ray_u_),
    plane.slope_v = plane.normal.dot(ray_v_);
    plane.endless = !p.x_range && plane.height < 0.0f;
    if (p.x_range)
      plane.x_min = static_cast<float>(p.x_range->x()),
      plane.x_max = static_cast<float>(p.x_range->y());
    planes_.push_back(plane);
  }
}

void PlaneView::seesRow(int u, int v, int count, std::uint8_t* out) const {
  if (planes_.size() == 1 && planes_[0].endless) {
    const float start = planes_[0].slope_0 + static_cast<float>(v) * planes_[0].slope_v,
                slope = planes_[0].slope_u;
    for (int i = 0; i < count; ++i)
      out[i] = start + static_cast<float>(u + i) * slope < -1e-9f ? 255 : 0;
    return;
  }
  for (int i = 0; i < count; ++i)
    out[i] = sees(static_cast<float>(u + i), static_cast<float>(v)) ? 255 : 0;
}

}  // namespace calipso::render
