#include "calipso_render/shadow_map.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "kernels.hpp"

namespace calipso::render {
namespace {

constexpr float kGoldenAngle = 2.39996323f;
constexpr int kMargin = 4;  // texels

// Evenly spread points of the unit disc (Vogel's spiral): the same for every pixel, so no noise.
std::shared_ptr<const ShadowTaps> discPattern(int count) {
  assert(count > 0 && count % 8 == 0 && count <= ShadowTaps::kMost);
  auto taps = std::make_shared<ShadowTaps>();
  taps->count = count;
  for (int i = 0; i < count; ++i) {
    const float r = std::sqrt((i + 0.5f) / count), a = i * kGoldenAngle;
    taps->x[i] = r * std::cos(a), taps->y[i] = r * std::sin(a);
  }
  return taps;
}

}  // namespace

ShadowMap::ShadowMap(const std::vector<Occluder>& occluders, const Eigen::Vector3d& direction,
                     const Params& params)
    : angular_radius_(static_cast<float>(params.angular_radius)), taps_(discPattern(params.taps)) {
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
  texel_ = side / (params.resolution - 2 * kMargin), per_texel_ = 1.0f / texel_;
  width_ = static_cast<int>((high.x() - low.x()) / texel_) + 2 * kMargin + 1;
  height_ = static_cast<int>((high.y() - low.y()) / texel_) + 2 * kMargin + 1;
  origin_ = Eigen::Vector3f(low.x() - kMargin * texel_, low.y() - kMargin * texel_, low.z());
  highest_ = high.z() - low.z();
  map_.emplace(cv::Rect(0, 0, width_, height_), false);
  for (const Occluder& o : occluders) {
    ScreenMesh mesh;
    mesh.triangles = o.triangles;
    mesh.hidden_side = -o.winding;  // the light looks along rows upwards
    mesh.points.resize(o.vertices->size());
#pragma omp parallel for schedule(static)
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      const Eigen::Vector3f& p = (*o.vertices)[i];
      mesh.points[i] = {(p.dot(axis_s_) - origin_.x()) * per_texel_, (p.dot(axis_t_) - origin_.y()) * per_texel_, p.dot(axis_h_) - origin_.z()};
    }
    map_->draw(mesh, 0);
  }
  buildLevels();
}

void ShadowMap::buildLevels() {
  std::vector<Extremes> own = coarsened();
  int width = (width_ + (1 << kFirstLevel) - 1) >> kFirstLevel, height = (height_ + (1 << kFirstLevel) - 1) >> kFirstLevel;
  while (true) {
    levels_.push_back(spread(own, width, height));
    if (std::max(width, height) <= 2) return;
    const int w = (width + 1) / 2, h = (height + 1) / 2;
    std::vector<Extremes> next(static_cast<std::size_t>(w) * h);
    for (int j = 0; j < height; ++j) {
      for (int i = 0; i < width; ++i) next[static_cast<std::size_t>(j / 2) * w + i / 2].include(own[static_cast<std::size_t>(j) * width + i]);
    }
    own = std::move(next), width = w, height = h;
  }
}

// Extremes of the first level's cells.
std::vector<ShadowMap::Extremes> ShadowMap::coarsened() const {
  constexpr int kCell = 1 << kFirstLevel;
  const int width = (width_ + kCell - 1) / kCell, height = (height_ + kCell - 1) / kCell;
  std::vector<Extremes> cells(static_cast<std::size_t>(width) * height);
#pragma omp parallel for schedule(static)
  for (int b = 0; b < height; ++b) {
    std::vector<float> low(map_->stride(), std::numeric_limits<float>::max()), high(map_->stride(), VisibilityBuffer::kFar);
    for (int j = b * kCell; j < std::min(height_, (b + 1) * kCell); ++j) {
      const float* row = map_->nearness(j);
      for (int i = 0; i < width_; ++i) low[i] = std::min(low[i], row[i]), high[i] = std::max(high[i], row[i]);
    }
    for (int i = 0; i < width_; ++i) cells[static_cast<std::size_t>(b) * width + i / kCell].include({low[i], high[i]});
  }
  return cells;
}

// Every cell with the eight around it.
ShadowMap::Level ShadowMap::spread(const std::vector<Extremes>& cells, int width, int height) {
  const Extremes nothing{VisibilityBuffer::kFar, VisibilityBuffer::kFar};
  Level level{width, height, std::vector<Extremes>(cells.size())};
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) {
      const bool rim = i == 0 || j == 0 || i + 1 == width || j + 1 == height;
      Extremes e = rim ? nothing : Extremes();  // beyond the map there is nothing
      for (int b = std::max(0, j - 1); b <= std::min(height - 1, j + 1); ++b) {
        for (int a = std::max(0, i - 1); a <= std::min(width - 1, i + 1); ++a) e.include(cells[static_cast<std::size_t>(b) * width + a]);
      }
      level.cells[static_cast<std::size_t>(j) * width + i] = e;
    }
  }
  return level;
}

// Bounds of the heights within `reach` texels.
ShadowMap::Extremes ShadowMap::around(float s, float t, float reach) const {
  std::size_t level = 0;
  int shift = kFirstLevel;
  while (level + 1 < levels_.size() && static_cast<float>(1 << shift) < reach) ++level, ++shift;
  const Level& l = levels_[level];
  if (static_cast<float>(1 << shift) < reach) return {VisibilityBuffer::kFar, highest_};
  const int i = std::clamp(static_cast<int>(s) >> shift, 0, l.width - 1), j = std::clamp(static_cast<int>(t) >> shift, 0, l.height - 1);
  Extremes e = l.cells[static_cast<std::size_t>(j) * l.width + i];
  if (s < 0.0f || t < 0.0f || s >= width_ || t >= height_) e.lowest = VisibilityBuffer::kFar;
  return e;
}

ShadowMap::Place ShadowMap::placeOf(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  const float slope = 1.0f - std::clamp(n.dot(axis_h_), 0.0f, 1.0f);
  const Eigen::Vector3f q = p + n * texel_ * (1.0f + 2.0f * slope);
  return {(q.dot(axis_s_) - origin_.x()) * per_texel_, (q.dot(axis_t_) - origin_.y()) * per_texel_, q.dot(axis_h_) - origin_.z() + 1.5f * texel_};
}

float ShadowMap::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  if (!map_) return 1.0f;
  const auto [s, t, h] = placeOf(p, n);
  if (h > highest_) return 1.0f;
  // Blockers inside the cone that the disc spans up to the highest occluder.
  const float search = std::max(1.5f, angular_radius_ * (highest_ - h) * per_texel_);
  if (s < -search || t < -search || s > width_ + search || t > height_ + search) return 1.0f;
  const Extremes near = around(s, t, search + 2.0f);
  if (near.highest <= h) return 1.0f;
  if (near.lowest > h) return 0.0f;
  return kernels().visibleThrough({map_->nearness(0), width_, height_, map_->stride(), angular_radius_ * per_texel_}, *taps_, s, t, h, search);
}

std::optional<float> ShadowMap::uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n, float radius) const {
  if (!map_) return 1.0f;
  const auto [s, t, h] = placeOf(p, n);
  const float lowest = h - radius, highest = h + radius;  // of the disc
  if (lowest > highest_) return 1.0f;
  const float reach = std::max(1.5f, angular_radius_ * (highest_ - lowest) * per_texel_) + 2.0f + radius * per_texel_;
  if (s < -reach || t < -reach || s > width_ + reach || t > height_ + reach) return 1.0f;
  const Extremes near = around(s, t, reach);
  if (near.highest <= lowest) return 1.0f;
  if (near.lowest > highest) return 0.0f;
  return std::nullopt;
}

}  // namespace calipso::render
