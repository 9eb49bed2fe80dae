#include "calipso_render/shadow_map.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "draw/kernels.hpp"
#include "draw/shadow_texels.hpp"

namespace calipso::render {
namespace {

constexpr float kGoldenAngle = 2.39996323f;
constexpr int kMargin = 4;  // texels
constexpr int kCell = 4;    // texels: side of the cells whose extremes are kept
constexpr int kFewCells = 4096;
constexpr float kTapMargin = 2.0f;  // texels that a tap reads beyond its place
constexpr float kWorthNarrowing = 0.8f;

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
  std::vector<ScreenMesh> meshes(occluders.size());
  for (std::size_t k = 0; k < occluders.size(); ++k) {
    const Occluder& o = occluders[k];
    ScreenMesh& mesh = meshes[k];
    mesh.triangles = o.triangles;
    mesh.hidden_side = -o.winding;  // the light looks along rows upwards
    mesh.points.resize(o.vertices->size());
#pragma omp parallel for schedule(static)
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      const Eigen::Vector3f& p = (*o.vertices)[i];
      mesh.points[i] = {(p.dot(axis_s_) - origin_.x()) * per_texel_,
                        (p.dot(axis_t_) - origin_.y()) * per_texel_, p.dot(axis_h_) - origin_.z()};
    }
  }
  map_.emplace(cv::Rect(0, 0, width_, height_), pointersTo(meshes), false);
  buildLevels();
}

// Extremes of windows of 2^k x 2^k cells, from every cell on: any rectangle is four of them.
void ShadowMap::buildLevels() {
  columns_ = (width_ + kCell - 1) / kCell, rows_ = (height_ + kCell - 1) / kCell;
  levels_.push_back(coarsened());
  for (int size = 2; size <= std::min(columns_, rows_); size *= 2) {
    const Level& half = levels_.back();
    Level level = unset();
    const int columns = columns_ - size + 1, step = size / 2;
#pragma omp parallel for schedule(static) if (columns_ * rows_ > kFewCells)
    for (int j = 0; j <= rows_ - size; ++j) {
      const std::size_t at = static_cast<std::size_t>(j) * columns_,
                        below = at + static_cast<std::size_t>(step) * columns_;
      const float *low = &half.low[at], *low_below = &half.low[below], *high = &half.high[at],
                  *high_below = &half.high[below];
      for (int i = 0; i < columns; ++i)
        level.low[at + i] =
            std::min(std::min(low[i], low[i + step]), std::min(low_below[i], low_below[i + step]));
      for (int i = 0; i < columns; ++i)
        level.high[at + i] = std::max(std::max(high[i], high[i + step]),
                                      std::max(high_below[i], high_below[i + step]));
    }
    levels_.push_back(std::move(level));
  }
}

ShadowMap::Level ShadowMap::unset() const {
  const std::size_t count = static_cast<std::size_t>(columns_) * rows_;
  return {std::unique_ptr<float[]>(new float[count]), std::unique_ptr<float[]>(new float[count])};
}

ShadowMap::Level ShadowMap::coarsened() const {
  Level cells = unset();
#pragma omp parallel for schedule(static)
  for (int b = 0; b < rows_; ++b) {
    std::vector<float> low(columns_ * kCell, std::numeric_limits<float>::max()),
        high(columns_ * kCell, VisibilityBuffer::kFar);
    for (int j = b * kCell; j < std::min(height_, (b + 1) * kCell); ++j) {
      const float* row = map_->nearness(j);
      for (int i = 0; i < width_; ++i)
        low[i] = std::min(low[i], row[i]), high[i] = std::max(high[i], row[i]);
    }
    for (int i = 0; i < columns_; ++i) {
      cells.low[static_cast<std::size_t>(b) * columns_ + i] =
          *std::min_element(&low[i * kCell], &low[i * kCell] + kCell);
      cells.high[static_cast<std::size_t>(b) * columns_ + i] =
          *std::max_element(&high[i * kCell], &high[i * kCell] + kCell);
    }
  }
  return cells;
}

// Bounds of the heights within `reach` texels, or of some more; beyond the map there is nothing.
ShadowMap::Extremes ShadowMap::around(float s, float t, float reach) const {
  const float left = s - reach, top = t - reach, right = s + reach, bottom = t + reach;
  if (!(right >= 0.0f && bottom >= 0.0f && left < width_ && top < height_))
    return {VisibilityBuffer::kFar, VisibilityBuffer::kFar};
  // Four windows of at least half the width cover the square; at the map's border they reach beyond
  // it.
  const int cells = static_cast<int>(2.0f * reach) / kCell + 2, k = 31 - __builtin_clz(cells),
            size = 1 << k;
  if (k >= static_cast<int>(levels_.size())) return {VisibilityBuffer::kFar, highest_};
  const Level& level = levels_[k];
  const auto windowAt = [size](float x, int count) {
    return std::clamp(static_cast<int>(x) / kCell, 0, count - size);
  };
  const int i0 = windowAt(left, columns_),
            i1 = windowAt(right - static_cast<float>((size - 1) * kCell), columns_);
  const std::size_t above = static_cast<std::size_t>(windowAt(top, rows_)) * columns_;
  const std::size_t below =
      static_cast<std::size_t>(windowAt(bottom - static_cast<float>((size - 1) * kCell), rows_)) *
      columns_;
  const bool inside = left >= 0.0f && top >= 0.0f && right < width_ && bottom < height_;
  return {inside ? std::min(std::min(level.low[above + i0], level.low[above + i1]),
                            std::min(level.low[below + i0], level.low[below + i1]))
                 : VisibilityBuffer::kFar,
          std::max(std::max(level.high[above + i0], level.high[above + i1]),
                   std::max(level.high[below + i0], level.high[below + i1]))};
}

// Bounds of the heights that can matter to a receiver at (s, t), of heights from `lowest` on: those
// in the cone that the disc spans up to the highest around, not of the whole map.
ShadowMap::Extremes ShadowMap::coneAround(float s, float t, float lowest, float margin) const {
  const float least = 1.5f + margin, per_height = angular_radius_ * per_texel_;
  const float reach = std::max(least, per_height * (highest_ - lowest) + margin);
  const Extremes wide = around(s, t, reach);
  if (wide.highest <= lowest) return wide;
  const float nearer = std::max(least, per_height * (wide.highest - lowest) + margin);
  return nearer < kWorthNarrowing * reach ? around(s, t, nearer) : wide;
}

ShadowMap::Place ShadowMap::placeOf(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  const float slope = 1.0f - std::clamp(n.dot(axis_h_), 0.0f, 1.0f);
  const Eigen::Vector3f q = p + n * texel_ * (1.0f + 2.0f * slope);
  return {(q.dot(axis_s_) - origin_.x()) * per_texel_, (q.dot(axis_t_) - origin_.y()) * per_texel_,
          q.dot(axis_h_) - origin_.z() + 1.5f * texel_};
}

float ShadowMap::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  if (!map_) return 1.0f;
  const auto [s, t, h] = placeOf(p, n);
  if (h > highest_) return 1.0f;
  const Extremes near = coneAround(s, t, h, kTapMargin);
  if (near.highest <= h) return 1.0f;
  if (near.lowest > h) return 0.0f;
  alignas(32) float places[6][8] = {};
  for (int c = 0; c < 3; ++c) places[c][0] = p[c], places[3 + c][0] = n[c];
  float visible[8];
  visibilities({{places[0], places[1], places[2]}, {places[3], places[4], places[5]}}, 1, visible);
  return visible[0];
}

void ShadowMap::visibilities(const LightPoints& points, int count, float* visible) const {
  if (map_)
    kernels().visible(texels(), *taps_, points, count, visible);
  else
    std::fill_n(visible, count, 1.0f);
}

ShadowTexels ShadowMap::texels() const {
  ShadowTexels texels{map_->nearness(0),
                      width_,
                      height_,
                      map_->stride(),
                      angular_radius_ * per_texel_,
                      {},
                      {},
                      texel_,
                      highest_};
  const Eigen::Vector3f* axes[] = {&axis_s_, &axis_t_, &axis_h_};
  for (int i = 0; i < 3; ++i) {
    Eigen::Map<Eigen::Vector3f>(texels.axes[i]) = *axes[i];
    texels.origin[i] = origin_[i];
  }
  return texels;
}

std::optional<float> ShadowMap::uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                                        float radius) const {
  if (!map_) return 1.0f;
  const auto [s, t, h] = placeOf(p, n);
  const float lowest = h - radius, highest = h + radius;  // of the disc
  if (lowest > highest_) return 1.0f;
  const Extremes near = coneAround(s, t, lowest, kTapMargin + radius * per_texel_);
  if (near.highest <= lowest) return 1.0f;
  if (near.lowest > highest) return 0.0f;
  return std::nullopt;
}

}  // namespace calipso::render
