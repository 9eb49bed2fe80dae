#include "calipso_render/ray_shadow.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "draw/ray_scene.hpp"

namespace calipso::render {
namespace {

constexpr float kGoldenAngle = 2.39996323f;
constexpr int kFirstRays = 6;  // if these agree, so do the others
// coprime to the numbers of rays in use; so many golden angles are a fifth of a turn
constexpr int kStride = 11;
constexpr float kLiftPart = 2e-4f;  // of the occluders' extent

}  // namespace

RayShadow::RayShadow(const std::vector<Occluder>& occluders, const Eigen::Vector3d& direction,
                     const Params& params)
    : scene_(std::make_unique<const RayScene>(occluders)),
      spread_(static_cast<float>(std::tan(params.angular_radius))) {
  axis_h_ = direction.normalized().cast<float>();
  axis_s_ = axis_h_.unitOrthogonal();
  axis_t_ = axis_h_.cross(axis_s_);
  low_ = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high_ = -low_;
  for (const Occluder& o : occluders) {
    if (o.triangles->empty()) continue;
    for (const Eigen::Vector3f& p : *o.vertices) {
      const Eigen::Vector3f q(p.dot(axis_s_), p.dot(axis_t_), p.dot(axis_h_));
      low_ = low_.cwiseMin(q), high_ = high_.cwiseMax(q);
    }
  }
  if (scene_->empty()) return;
  lift_ = kLiftPart * (high_ - low_).norm();
  // Vogel's spiral, strided so that the first few rays already spread over the disc.
  for (int i = 0; i < params.rays; ++i) {
    const int k = (i * kStride) % params.rays;
    const float r = spread_ * std::sqrt((k + 0.5f) / params.rays), a = k * kGoldenAngle;
    rays_.push_back((axis_h_ + r * std::cos(a) * axis_s_ + r * std::sin(a) * axis_t_).normalized());
  }
}

RayShadow::~RayShadow() = default;

bool RayShadow::empty() const { return scene_->empty(); }

std::optional<float> RayShadow::uniform(const Eigen::Vector3f& p, const Eigen::Vector3f&,
                                        float radius) const {
  if (scene_->empty()) return 1.0f;
  const Eigen::Vector3f q(p.dot(axis_s_), p.dot(axis_t_), p.dot(axis_h_));
  const float around = radius + 4.0f * lift_,
              reach = around + spread_ * (high_.z() - q.z() + around);
  const bool clear = high_.z() < q.z() - around || q.x() + reach < low_.x() ||
                     q.x() - reach > high_.x() || q.y() + reach < low_.y() ||
                     q.y() - reach > high_.y();
  return clear ? std::make_optional(1.0f) : std::nullopt;
}

float RayShadow::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  if (scene_->empty()) return 1.0f;
  const Eigen::Vector3f from = p + n * lift_ * 4.0f;
  const Eigen::Vector3f q(from.dot(axis_s_), from.dot(axis_t_), from.dot(axis_h_));
  const float reach = spread_ * (high_.z() - q.z());
  const bool clear = reach < 0.0f || q.x() + reach < low_.x() || q.x() - reach > high_.x() ||
                     q.y() + reach < low_.y() || q.y() - reach > high_.y();
  if (clear) return 1.0f;
  const int all = static_cast<int>(rays_.size()), first = std::min(kFirstRays, all);
  int hits = 0;
  for (int i = 0; i < first; ++i) hits += scene_->blocked(from, rays_[i]);
  if (hits == 0 || hits == first) return hits == 0 ? 1.0f : 0.0f;
  for (int i = first; i < all; ++i) hits += scene_->blocked(from, rays_[i]);
  return 1.0f - static_cast<float>(hits) / all;
}

}  // namespace calipso::render
