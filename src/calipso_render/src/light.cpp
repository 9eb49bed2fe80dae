#include "calipso_render/light.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::render {

std::array<float, 9> shBasis(const Eigen::Vector3f& n) {
  const float x = n.x(), y = n.y(), z = n.z();
  return {1.0f, y, z, x, x * y, y * z, 3.0f * z * z - 1.0f, x * z, x * x - y * y};
}

cv::Vec3f ambientAt(const Light& light, const Eigen::Vector3f& n) {
  const std::array<float, 9> basis = shBasis(n);
  cv::Vec3f sum;
  for (int i = 0; i < 9; ++i) sum += light.ambient[i] * basis[i];
  // Harmonics may dip below zero where nothing was seen; light cannot.
  for (int c = 0; c < 3; ++c) sum[c] = std::max(sum[c], 0.02f * light.ambient[0][c]);
  return sum;
}

cv::Vec3f diffuseShading(const Light& light, const Eigen::Vector3f& n, float sun, float sky) {
  return ambientAt(light, n) * sky + light.sun * (std::max(0.0f, n.dot(light.direction)) * sun);
}

float torranceSparrow(const Eigen::Vector3f& n, const Eigen::Vector3f& l, const Eigen::Vector3f& v, float m) {
  const float nl = n.dot(l), nv = n.dot(v);
  if (nl <= 1e-4f || nv <= 1e-4f) return 0.0f;
  const Eigen::Vector3f h = (l + v).normalized();
  const float nh = std::max(n.dot(h), 1e-4f), vh = std::max(v.dot(h), 1e-4f);
  const float c2 = nh * nh, m2 = m * m;
  const float D = std::exp((c2 - 1.0f) / (c2 * m2)) / (m2 * c2 * c2);  // Beckmann, times pi
  const float G = std::min({1.0f, 2.0f * nh * nv / vh, 2.0f * nh * nl / vh});
  return D * G / (4.0f * nv);
}

}  // namespace calipso::render
