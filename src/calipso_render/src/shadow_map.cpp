#include "calipso_render/shadow_map.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

constexpr float kGoldenAngle = 2.39996323f;
constexpr int kMargin = 4;  // texels

// Evenly spread points of the unit disc (Vogel's spiral): the same for every pixel, so no noise.
std::vector<Eigen::Vector2f> discPattern(int count) {
  std::vector<Eigen::Vector2f> points(count);
  for (int i = 0; i < count; ++i) {
    const float r = std::sqrt((i + 0.5f) / count), a = i * kGoldenAngle;
    points[i] = {r * std::cos(a), r * std::sin(a)};
  }
  return points;
}

}  // namespace

ShadowMap::ShadowMap(const std::vector<Occluder>& occluders, const Eigen::Vector3d& direction,
                     const Params& params)
    : angular_radius_(static_cast<float>(params.angular_radius)), pattern_(discPattern(params.taps)) {
  axis_h_ = direction.normalized().cast<float>();
  axis_s_ = axis_h_.unitOrthogonal();
  axis_t_ = axis_h_.cross(axis_s_);
  Eigen::Vector3f low = Eigen::Vector3f::Constant(1e30f), high = -low;
  for (const Occluder& o : occluders) {
    for (const Eigen::Vector3f& p : *o.vertices) {
      const Eigen::Vector3f q(p.dot(axis_s_), p.dot(axis_t_), p.dot(axis_h_));
      low = low.cwiseMin(q), high = high.cwiseMax(q);
    }
  }
  if (!(high.x() >= low.x())) return;  // nothing casts a shadow
  const float side = std::max({high.x() - low.x(), high.y() - low.y(), 1e-6f});
  texel_ = side / (params.resolution - 2 * kMargin);
  width_ = static_cast<int>((high.x() - low.x()) / texel_) + 2 * kMargin + 1;
  height_ = static_cast<int>((high.y() - low.y()) / texel_) + 2 * kMargin + 1;
  origin_ = Eigen::Vector3f(low.x() - kMargin * texel_, low.y() - kMargin * texel_, low.z());
  highest_ = high.z() - low.z();
  VisibilityBuffer buffer({0, 0, width_, height_});
  for (const Occluder& o : occluders) {
    ScreenMesh mesh;
    mesh.triangles = o.triangles;
    mesh.points.reserve(o.vertices->size());
    for (const Eigen::Vector3f& p : *o.vertices) {
      mesh.points.emplace_back((p.dot(axis_s_) - origin_.x()) / texel_,
                               (p.dot(axis_t_) - origin_.y()) / texel_, p.dot(axis_h_) - origin_.z());
    }
    buffer.draw(mesh, 0);
  }
  heights_.assign(buffer.nearness(0), buffer.nearness(0) + static_cast<std::size_t>(width_) * height_);
}

float ShadowMap::heightAt(float s, float t) const {
  const int i = static_cast<int>(std::floor(s + 0.5f)), j = static_cast<int>(std::floor(t + 0.5f));
  if (i < 0 || j < 0 || i >= width_ || j >= height_) return VisibilityBuffer::kFar;
  return heights_[static_cast<std::size_t>(j) * width_ + i];
}

// Fraction of the four nearest texels that lie above `height`, weighted bilinearly.
float ShadowMap::coveredAt(float s, float t, float height) const {
  const float fs = std::floor(s), ft = std::floor(t);
  const int i = static_cast<int>(fs), j = static_cast<int>(ft);
  if (i < 0 || j < 0 || i + 1 >= width_ || j + 1 >= height_) return 0.0f;
  const float* row = &heights_[static_cast<std::size_t>(j) * width_ + i];
  const float a = row[0] > height, b = row[1] > height, c = row[width_] > height,
              d = row[width_ + 1] > height;
  const float x = s - fs, y = t - ft;
  return (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y;
}

float ShadowMap::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  if (heights_.empty()) return 1.0f;
  // The start is lifted off the surface by a texel or two, so that it does not shade itself.
  const float slope = 1.0f - std::clamp(n.dot(axis_h_), 0.0f, 1.0f);
  const Eigen::Vector3f q = p + n * texel_ * (1.0f + 2.0f * slope);
  const float s = (q.dot(axis_s_) - origin_.x()) / texel_;
  const float t = (q.dot(axis_t_) - origin_.y()) / texel_;
  const float h = q.dot(axis_h_) - origin_.z() + 1.5f * texel_;
  if (h > highest_) return 1.0f;
  // Blockers inside the cone that the disc spans up to the highest occluder.
  const float search = std::max(1.5f, angular_radius_ * (highest_ - h) / texel_);
  if (s < -search || t < -search || s > width_ + search || t > height_ + search) return 1.0f;
  float sum = 0.0f;
  int blockers = 0;
  for (const Eigen::Vector2f& d : pattern_) {
    const float height = heightAt(s + search * d.x(), t + search * d.y());
    if (height > h) sum += height - h, ++blockers;
  }
  if (blockers == 0) return 1.0f;
  const float radius = std::max(1.0f, angular_radius_ * sum / blockers / texel_);
  float covered = 0.0f;
  for (const Eigen::Vector2f& d : pattern_) covered += coveredAt(s + radius * d.x(), t + radius * d.y(), h);
  return 1.0f - covered / pattern_.size();
}

}  // namespace calipso::render
