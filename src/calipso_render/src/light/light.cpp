#include "calipso_render/light.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr double kHorizon = 1e-4;  // cosine below which a direction counts as below the horizon

}  // namespace

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

cv::Vec3f thrownBack(const cv::Vec3f& reflectance) {
  constexpr float kMost = 0.9f;  // of a channel's light: saturated colours are told with errors
  const float grey = luminance(reflectance);
  if (!(grey > 0.0f)) return cv::Vec3f::all(kThrownBack);
  cv::Vec3f back;
  for (int c = 0; c < 3; ++c) back[c] = std::min(kMost, kThrownBack * reflectance[c] / grey);
  return back;
}

cv::Vec3f ambientOn(const Light& light, const SkySeen& seen, const cv::Vec3f& thrown_back) {
  const std::array<cv::Vec3f, 9>& A = light.ambient;
  const auto first = [&](float zeroth, const Eigen::Vector3f& d) {
    return A[0] * zeroth + A[1] * d.y() + A[2] * d.z() + A[3] * d.x();
  };
  cv::Vec3f sum = first(seen.open, seen.towards);
  const std::array<float, 9> basis = shBasis(seen.towards.normalized());
  for (int i = 4; i < 9; ++i) sum += A[i] * (basis[i] * seen.open);
  sum += thrown_back.mul(first(seen.thrown, seen.thrown_towards) +
                         light.sun * sunThrown(seen, light.direction));
  // Harmonics may dip below zero where nothing was seen; light cannot.
  for (int c = 0; c < 3; ++c) sum[c] = std::max(sum[c], 0.02f * A[0][c]);
  return sum;
}

cv::Vec3f diffuseShading(const Light& light, const Eigen::Vector3f& n, float sun,
                         const SkySeen& seen, const cv::Vec3f& thrown_back) {
  return ambientOn(light, seen, thrown_back) +
         light.sun * (std::max(0.0f, n.dot(light.direction)) * sun);
}

cv::Vec3f diffuseShading(const Light& light, const Eigen::Vector3f& n, float sun) {
  return ambientAt(light, n) + light.sun * (std::max(0.0f, n.dot(light.direction)) * sun);
}

float torranceSparrow(const Eigen::Vector3f& n, const Eigen::Vector3f& l, const Eigen::Vector3f& v,
                      float m) {
  const float nl = n.dot(l), nv = n.dot(v);
  if (nl <= kHorizon || nv <= kHorizon) return 0.0f;
  const Eigen::Vector3f sum = l + v;
  const float length = sum.norm(), c = n.dot(sum) / length, vh = 0.5f * length, m2 = m * m;
  const float root = 1.0f - c * c * (1.0f - m2), D = m2 / (root * root);
  const float G = std::min({1.0f, 2.0f * c * nv / vh, 2.0f * c * nl / vh});
  return D * G / (4.0f * nv);
}

Lobe torranceSparrowLobe(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                         const Eigen::Vector3d& v, double m) {
  const double nl = n.dot(l), nv = n.dot(v);
  if (nl <= kHorizon || nv <= kHorizon) return {};
  // For unit vectors v.h = l.h = |l + v| / 2.
  const Eigen::Vector3d sum = l + v;
  const double length = sum.norm(), c = n.dot(sum) / length, vh = 0.5 * length;
  const Eigen::Vector3d h = sum / length, dc = (n - c * h) / length, dvh = 0.5 * h;
  const double c2 = c * c, m2 = m * m, root = 1.0 - c2 * (1.0 - m2), D = m2 / (root * root);
  const double dD_dc = D * 4.0 * c * (1.0 - m2) / root, dD_dm = D * (2.0 / m - 4.0 * c2 * m / root);
  double G = 1.0;
  Eigen::Vector3d dG = Eigen::Vector3d::Zero();
  if (2.0 * c * nv / vh < G) G = 2.0 * c * nv / vh, dG = 2.0 * nv * (dc * vh - c * dvh) / (vh * vh);
  if (2.0 * c * nl / vh < G)
    G = 2.0 * c * nl / vh, dG = 2.0 * ((dc * nl + c * n) * vh - c * nl * dvh) / (vh * vh);
  const double scale = 1.0 / (4.0 * nv);
  return {D * G * scale, (dD_dc * dc * G + D * dG) * scale, dD_dm * G * scale};
}

cv::Vec3f specularShading(const Light& light, const Gloss& gloss, const Eigen::Vector3f& n,
                          const Eigen::Vector3f& view, float sun, float sky) {
  if (gloss.specular <= 0.0f && gloss.around <= 0.0f) return {};
  const float n_v = n.dot(view);
  cv::Vec3f radiance = ambientAt(asMirrored(light), mirroredIn(n, view)) *
                       (gloss.around * sky * grazing(n_v, grazingGrowth(gloss)));
  if (sun > 0.0f)
    radiance += light.sun *
                (gloss.specular * sun * torranceSparrow(n, light.direction, view, gloss.roughness));
  return radiance;
}

}  // namespace calipso::render
