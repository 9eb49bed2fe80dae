#include "calipso_render/sky_map.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "draw/eight_lanes.hpp"
#include "draw/wide_loops.hpp"

namespace calipso::render {
namespace {

constexpr float kGoldenAngle = 2.39996323f;
constexpr int kMostDirections = 64;
constexpr int kMargin = 2;  // texels around the occluders, where nothing is
// units of a kept height, and as many as it has at most: fewer than an open column's lowest
constexpr float kPerTexel = 64.0f, kHighest = 65534.0f;
constexpr float kOwnSurface = 2.0f;  // texels: what reaches no higher over a point is its own plane
// A column with nothing in it: its lowest is over its highest.
constexpr std::uint32_t kOpen = 0xffffu;

std::uint32_t unitsOf(float texels) {
  return static_cast<std::uint32_t>(std::clamp(texels * kPerTexel, 0.0f, kHighest));
}

// What a look up through the columns needs.
struct Look {
  const std::uint32_t* columns;
  int width, depth;
  float height;        // of the highest, texels
  float farthest;      // over the point, from where on nothing counts, texels
  const float *x, *y;  // of the directions, per height
  float s, t, h;       // the point, texels
  float first;         // height over it below which no direction meets anything, texels
};

CALIPSO_INLINE EightInts columnsAt(const Look& look, const Eight& s, const Eight& t) {
  const Eight right = all(static_cast<float>(look.width - 1)),
              bottom = all(static_cast<float>(look.depth - 1));
  const EightInts i = __builtin_convertvector(smaller(larger(s, Eight{}), right) + 0.5f, EightInts),
                  j = __builtin_convertvector(smaller(larger(t, Eight{}), bottom) + 0.5f,
                                              EightInts);
  const EightInts at = j * look.width + i;
  EightInts columns;
  for (int k = 0; k < 8; ++k) columns[k] = static_cast<std::int32_t>(look.columns[at[k]]);
  return columns;
}

// How many of the directions nothing closes: they are followed up slab by slab, which grow with the
// height as the directions part; a column that is at least partly in a slab closes those that are
// over it half way.
CALIPSO_WIDE_LOOPS int openDirections(const Look& look, int directions) {
  EightInts closed[kMostDirections / 8] = {};
  const int groups = directions / 8;
  for (float from = look.first, to = 2.0f * from + 1.0f;
       look.h + from < look.height && from < look.farthest; from = to, to *= 2.0f) {
    const float half_way = 0.5f * (from + to);
    const int lowest = static_cast<int>((look.h + std::max(from, kOwnSurface)) * kPerTexel),
              highest = static_cast<int>(
                  std::min((look.h + std::min(to, look.farthest)) * kPerTexel, kHighest));
    for (int g = 0; g < groups; ++g) {
      const EightInts column = columnsAt(look, look.s + half_way * eightAt(look.x + 8 * g),
                                         look.t + half_way * eightAt(look.y + 8 * g));
      closed[g] |= ((column & 0xffff) < highest) & (((column >> 16) & 0xffff) > lowest);
    }
  }
  int open = directions;
  for (int g = 0; g < groups; ++g)
    for (int k = 0; k < 8; ++k) open += closed[g][k];
  return open;
}

}  // namespace

SkyMap::SkyMap(const std::vector<Occluder>& occluders, const Eigen::Vector3d& up,
               const Params& params)
    : spread_(static_cast<float>(std::tan(params.angular_radius))) {
  static_assert(kDirections % 8 == 0 && kDirections <= kMostDirections);
  assert(params.resolution >= 16);
  axis_h_ = up.normalized().cast<float>();
  axis_s_ = axis_h_.unitOrthogonal();
  axis_t_ = axis_h_.cross(axis_s_);
  for (int k = 0; k < kDirections; ++k) {  // Vogel's spiral
    const float r = spread_ * std::sqrt((k + 0.5f) / kDirections), a = k * kGoldenAngle;
    x_[k] = r * std::cos(a), y_[k] = r * std::sin(a);
  }
  Eigen::Vector3f low = Eigen::Vector3f::Constant(1e30f), high = -low;
  for (const Occluder& o : occluders) {
    if (o.triangles->empty()) continue;
    for (const Eigen::Vector3f& p : *o.vertices) {
      const Eigen::Vector3f q(p.dot(axis_s_), p.dot(axis_t_), p.dot(axis_h_));
      low = low.cwiseMin(q), high = high.cwiseMax(q);
    }
  }
  if (!(high.x() >= low.x())) return;  // nothing hides anything
  const Eigen::Vector3f size = high - low;
  texel_ =
      std::max({size.x(), size.y(), 1e-6f}) / static_cast<float>(params.resolution - 2 * kMargin);
  texel_ = std::max(texel_, size.z() * kPerTexel / kHighest);
  origin_ = low - kMargin * texel_ * Eigen::Vector3f(1.0f, 1.0f, 0.0f);
  width_ = static_cast<int>(size.x() / texel_) + 2 * kMargin + 1;
  depth_ = static_cast<int>(size.y() / texel_) + 2 * kMargin + 1;
  height_ = size.z() / texel_;
  farthest_ = static_cast<float>(params.farthest) / texel_;
  keepHeights(occluders);
}

void SkyMap::keepHeights(const std::vector<Occluder>& occluders) {
  std::vector<ScreenMesh> above(occluders.size());
  for (std::size_t k = 0; k < occluders.size(); ++k) {
    const Occluder& o = occluders[k];
    ScreenMesh& mesh = above[k];
    mesh.triangles = o.triangles;
    mesh.hidden_side = -o.winding;  // from above, along rows upwards
    mesh.points.resize(o.vertices->size());
#pragma omp parallel for schedule(static)
    for (std::size_t i = 0; i < mesh.points.size(); ++i) mesh.points[i] = placeOf((*o.vertices)[i]);
  }
  std::vector<ScreenMesh> below = above;
  for (ScreenMesh& mesh : below) {
    mesh.hidden_side = -mesh.hidden_side;
    for (Eigen::Vector3f& p : mesh.points) p.z() = -p.z();
  }
  const cv::Rect all(0, 0, width_, depth_);
  const VisibilityBuffer tops(all, pointersTo(above), false),
      bottoms(all, pointersTo(below), false);
  columns_.assign(static_cast<std::size_t>(width_) * depth_, kOpen);
#pragma omp parallel for schedule(static)
  for (int j = 0; j < depth_; ++j) {
    const float *top = tops.nearness(j), *bottom = bottoms.nearness(j);
    for (int i = 0; i < width_; ++i)
      if (top[i] != VisibilityBuffer::kFar && bottom[i] != VisibilityBuffer::kFar)
        columns_[static_cast<std::size_t>(j) * width_ + i] =
            unitsOf(top[i]) << 16 | std::min(unitsOf(-bottom[i]), unitsOf(top[i]));
  }
}

// Texels, from the map's corner and the lowest height.
Eigen::Vector3f SkyMap::placeOf(const Eigen::Vector3f& p) const {
  const Eigen::Vector3f q(p.dot(axis_s_), p.dot(axis_t_), p.dot(axis_h_));
  return (q - origin_) / texel_;
}

// No direction of points within `radius` texels reaches the occluders' box.
bool SkyMap::isClear(const Eigen::Vector3f& place, float radius) const {
  const float above = height_ - place.z() + radius;
  return above <= 0.0f || besideBox(place) > radius + 1.0f + spread_ * above;
}

// Texels from the occluders' box, seen from above.
float SkyMap::besideBox(const Eigen::Vector3f& place) const {
  const float right = static_cast<float>(width_ - kMargin),
              bottom = static_cast<float>(depth_ - kMargin);
  return std::max(
      {kMargin - place.x(), place.x() - right, kMargin - place.y(), place.y() - bottom, 0.0f});
}

float SkyMap::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const {
  if (columns_.empty()) return 1.0f;
  const Eigen::Vector3f place = placeOf(p);
  if (isClear(place, 0.0f)) return 1.0f;
  const float first = std::max(0.0f, besideBox(place) - 1.0f) / spread_;
  const Look look{columns_.data(), width_,    depth_,    height_, farthest_, x_, y_,
                  place.x(),       place.y(), place.z(), first};
  return static_cast<float>(openDirections(look, kDirections)) / kDirections;
}

std::optional<float> SkyMap::uniform(const Eigen::Vector3f& p, const Eigen::Vector3f&,
                                     float radius) const {
  const bool clear = columns_.empty() || isClear(placeOf(p), radius / texel_);
  return clear ? std::make_optional(1.0f) : std::nullopt;
}

}  // namespace calipso::render
