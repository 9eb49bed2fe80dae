#include "point_light.hpp"

#include <algorithm>

namespace calipso::render {
namespace {

cv::v_float32x4 wide(const cv::Vec3f& c) { return {c[0], c[1], c[2], 0.0f}; }

}  // namespace

PointLight::PointLight(const Light& light)
    : direction_(light.direction), sun_(wide(light.sun)), least_(wide(0.02f * light.ambient[0])) {
  for (int i = 0; i < 9; ++i) {
    ambient_[i] = wide(light.ambient[i]);
    if (light.ambient[i] != cv::Vec3f()) terms_ = i == 0 ? 1 : i < 4 ? 4 : 9;
  }
}

cv::v_float32x4 PointLight::ambientAt(const Eigen::Vector3f& n) const {
  cv::v_float32x4 sum = ambient_[0];
  if (terms_ > 1)
    sum += ambient_[1] * cv::v_setall_f32(n.y()) + ambient_[2] * cv::v_setall_f32(n.z()) +
           ambient_[3] * cv::v_setall_f32(n.x());
  if (terms_ > 4) {
    const std::array<float, 9> basis = shBasis(n);
    for (int i = 4; i < 9; ++i) sum += ambient_[i] * cv::v_setall_f32(basis[i]);
  }
  return cv::v_max(sum, least_);
}

PointLight::Shading PointLight::at(const Gloss& gloss, const cv::Vec3f& tint,
                                   const Eigen::Vector3f& n, const Eigen::Vector3f& view, float sun,
                                   float sky) const {
  Shading shading;
  const float cosine = std::max(0.0f, n.dot(direction_));
  cv::v_store(shading.diffuse.val,
              ambientAt(n) * (cv::v_setall_f32(sky) + wide(tint) * cv::v_setall_f32(1.0f - sky)) +
                  sun_ * cv::v_setall_f32(cosine * sun));
  if (gloss.specular <= 0.0f) return shading;
  const float n_v = n.dot(view);
  cv::v_float32x4 highlight =
      ambientAt(2.0f * n_v * n - view) * cv::v_setall_f32(gloss.specular * sky * grazing(n_v));
  if (sun > 0.0f && cosine > 0.0f)
    highlight += sun_ * cv::v_setall_f32(gloss.specular * sun *
                                         torranceSparrow(n, direction_, view, gloss.roughness));
  cv::v_store(shading.highlight.val, highlight);
  return shading;
}

}  // namespace calipso::render
