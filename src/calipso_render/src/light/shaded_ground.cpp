#include "light/shaded_ground.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "calipso_render/colour.hpp"
#include "calipso_render/sky_map.hpp"

namespace calipso::render {
namespace {

constexpr float kLevel = 1e-3f;    // slope of the flattest direction that is followed to a plane
constexpr float kBeneath = 0.02f;  // m that a contact may be below its plane

// Part of the light on a surface with unit normal n that is the sun's.
float sunsPart(const Light& light, const Eigen::Vector3f& n) {
  const float sun = luminance(light.sun) * std::max(0.0f, n.dot(light.direction));
  return sun / std::max(1e-6f, sun + luminance(ambientAt(light, n)));
}

}  // namespace

ShadedGround::ShadedGround(const std::vector<SupportPlane>& planes, const Light& light,
                           std::vector<const Visibility*> suns, const Visibility& sky)
    : suns_(std::move(suns)), sky_(&sky) {
  constexpr float kEverywhere = std::numeric_limits<float>::max();
  for (const SupportPlane& plane : planes) {
    const Eigen::Vector3f n = plane.normal.cast<float>();
    planes_.push_back(
        {n, static_cast<float>(plane.offset), {-kEverywhere, kEverywhere}, sunsPart(light, n)});
    if (plane.x_range) planes_.back().x_range = plane.x_range->cast<float>().array();
  }
}

float ShadedGround::lit(const Eigen::Vector3f& p, const Eigen::Vector3f& w) const {
  const Plane* met = nullptr;
  float nearest = std::numeric_limits<float>::max();
  for (const Plane& plane : planes_) {
    const float slope = -plane.normal.dot(w), height = plane.normal.dot(p) - plane.offset;
    if (slope < kLevel || height < -kBeneath) continue;
    const float way = std::max(0.0f, height) / slope, x = p.x() + way * w.x();
    if (way >= nearest || x < plane.x_range[0] || x > plane.x_range[1]) continue;
    met = &plane, nearest = way;
  }
  if (met == nullptr) return 1.0f;
  const Eigen::Vector3f hit = p + nearest * w;
  float sun = met->sun;
  for (const Visibility* s : suns_) sun *= s->visibility(hit, met->normal);
  return sun + (1.0f - met->sun) * skyLight(sky_->visibility(hit, met->normal));
}

}  // namespace calipso::render
