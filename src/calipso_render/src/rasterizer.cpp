#include "calipso_render/rasterizer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels.hpp"
#include "triangle_span.hpp"

namespace calipso::render {
namespace {

constexpr double kNearPlane = 1e-6;       // m in front of the camera
constexpr float kEdgeTolerance = 1e-3f;   // px; shared edges belong to both sides, so no cracks
constexpr float kSmallestArea = 1e-9f;    // px^2
constexpr std::size_t kFewPoints = 4096;  // not worth sharing out

// Without SSE 4.1 std::floor and std::ceil are calls; |x| must fit an int.
int floorInt(float x) {
  const int i = static_cast<int>(x);
  return i - (static_cast<float>(i) > x);
}
int ceilInt(float x) {
  const int i = static_cast<int>(x);
  return i + (static_cast<float>(i) < x);
}

// Rows and columns that a triangle can reach. @return false if there are none
bool setLimits(const Eigen::Vector3f (&p)[3], const cv::Rect& region, TriangleSpan& span) {
  const float left = std::min({p[0].x(), p[1].x(), p[2].x()}),
              right = std::max({p[0].x(), p[1].x(), p[2].x()});
  const float top = std::min({p[0].y(), p[1].y(), p[2].y()}),
              bottom = std::max({p[0].y(), p[1].y(), p[2].y()});
  // Written so that NaN fails every comparison.
  if (!(right >= 0 && bottom >= 0 && left <= region.width - 1 && top <= region.height - 1))
    return false;
  span.row_min = ceilInt(std::max(0.0f, top - kEdgeTolerance));
  span.row_max = floorInt(std::min(region.height - 1.0f, bottom + kEdgeTolerance));
  span.column_min = ceilInt(std::max(0.0f, left - kEdgeTolerance));
  span.column_max = floorInt(std::min(region.width - 1.0f, right + kEdgeTolerance));
  return span.row_min <= span.row_max && span.column_min <= span.column_max;
}

bool makeSpan(const ScreenMesh& mesh, int triangle, const cv::Rect& region, TriangleSpan& span) {
  const Eigen::Vector3i& t = (*mesh.triangles)[triangle];
  const Eigen::Vector3f offset(region.x, region.y, 0.0f);
  const Eigen::Vector3f p[3] = {mesh.points[t[0]] - offset, mesh.points[t[1]] - offset,
                                mesh.points[t[2]] - offset};
  const float area =
      (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) - (p[2].x() - p[0].x()) * (p[1].y() - p[0].y());
  if (mesh.hides(area) || !(std::abs(area) > kSmallestArea) ||
      std::isnan(p[0].z() + p[1].z() + p[2].z()))
    return false;
  if (!setLimits(p, region, span)) return false;
  for (int i = 0; i < 4; ++i) {
    constexpr float kNoBound = 1e9f;
    span.column[i] = i < 2 ? -kNoBound : kNoBound, span.row[i] = span.slope[i] = 0.0f;
  }
  // The edges that rise bound one side, those that fall the other: at most two, since they close.
  int lefts = 0, rights = 2;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f& start = p[(i + 1) % 3];
    const Eigen::Vector3f& end = p[(i + 2) % 3];
    const float dx = end.x() - start.x(), dy = end.y() - start.y();
    if (std::abs(dy) < kEdgeTolerance) continue;  // level: the rows' limits bound it
    // The edge is moved out by kEdgeTolerance: along the row by that times length / |dy|.
    const float slope = dx / dy, reach = kEdgeTolerance * std::sqrt(1.0f + slope * slope);
    const bool is_left = (area > 0.0f) == (dy < 0.0f);
    const int k = is_left ? lefts++ : rights++;
    span.column[k] = is_left ? start.x() - reach : start.x() + reach, span.row[k] = start.y(),
    span.slope[k] = slope;
  }
  const float dz1 = p[1].z() - p[0].z(), dz2 = p[2].z() - p[0].z(), per_area = 1.0f / area;
  span.near_u = (dz1 * (p[2].y() - p[0].y()) - dz2 * (p[1].y() - p[0].y())) * per_area;
  span.near_v = (dz2 * (p[1].x() - p[0].x()) - dz1 * (p[2].x() - p[0].x())) * per_area;
  span.near_0 = p[0].z() - span.near_u * p[0].x() - span.near_v * p[0].y();
  return true;
}

}  // namespace

ScreenMesh projectMesh(const Points& world, const Triangles& triangles, const Camera& camera) {
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  ScreenMesh mesh;
  mesh.triangles = &triangles;
  mesh.points.resize(world.size());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Eigen::Matrix3d R = camera_from_world.linear();
  const Eigen::Vector3d t = camera_from_world.translation();
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < world.size(); ++i) {
    const Eigen::Vector3d p = R * world[i].cast<double>() + t;
    if (!(p.z() > kNearPlane)) {
      mesh.points[i].setConstant(nan);
      continue;
    }
    const Eigen::Vector2d q = camera.project(p);
    mesh.points[i] = Eigen::Vector3d(q.x(), q.y(), 1.0 / p.z()).cast<float>();
  }
  return mesh;
}

cv::Rect boundsOf(const ScreenMesh& mesh, int margin, cv::Size size) {
  float left = 1e9f, top = 1e9f, right = -1e9f, bottom = -1e9f;
#pragma omp parallel for schedule(static) if (mesh.points.size() > kFewPoints) \
    reduction(min                                                              \
              : left, top) reduction(max                                       \
                                     : right, bottom)
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    const Eigen::Vector3f& p = mesh.points[i];
    if (std::isnan(p.z())) continue;
    left = std::min(left, p.x()), right = std::max(right, p.x());
    top = std::min(top, p.y()), bottom = std::max(bottom, p.y());
  }
  const auto clampTo = [](float x, int limit) {
    return static_cast<int>(std::clamp(x, -1.0f, static_cast<float>(limit)));
  };
  const int u0 = std::max(0, clampTo(std::floor(left) - margin, size.width));
  const int v0 = std::max(0, clampTo(std::floor(top) - margin, size.height));
  const int u1 = clampTo(std::ceil(right) + margin + 1, size.width);
  const int v1 = clampTo(std::ceil(bottom) + margin + 1, size.height);
  return {u0, v0, std::max(0, u1 - u0), std::max(0, v1 - v0)};
}

VisibilityBuffer::VisibilityBuffer(const cv::Rect& region, bool with_ids)
    : region_(region),
      stride_(region.width + kPadding),
      ids_(with_ids ? new std::uint32_t[static_cast<std::size_t>(stride_) * region.height]
                    : nullptr),
      near_(new float[static_cast<std::size_t>(stride_) * region.height]) {
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region.height; ++v) {
    const std::size_t first = static_cast<std::size_t>(v) * stride_;
    if (with_ids) std::fill_n(&ids_[first], stride_, kNothing);
    std::fill_n(&near_[first], stride_, kFar);
  }
}

void VisibilityBuffer::draw(const ScreenMesh& mesh, int object) {
  const int count = static_cast<int>(mesh.triangles->size());
  std::vector<TriangleSpan> parts[kParts];  // of the triangles, in their order
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (int part = 0; part < kParts; ++part) {
      const int begin = static_cast<int>(static_cast<long>(count) * part / kParts),
                end = static_cast<int>(static_cast<long>(count) * (part + 1) / kParts);
      parts[part].reserve(end - begin);
      TriangleSpan span;
      for (int t = begin; t < end; ++t) {
        span.id = (static_cast<std::uint32_t>(object) << 24) | static_cast<std::uint32_t>(t);
        if (makeSpan(mesh, t, region_, span)) parts[part].push_back(span);
      }
    }
#pragma omp for schedule(dynamic, 1)
    for (int band = 0; band < kBands; ++band) {
      const int first = region_.height * band / kBands,
                last = region_.height * (band + 1) / kBands - 1;
      const SpanTarget target{ids_.get(), near_.get(), stride_, first, last};
      for (const auto& part : parts)
        kernels().fill(part.data(), static_cast<int>(part.size()), target);
    }
  }
}

Eigen::Vector3f barycentric(const ScreenMesh& mesh, int triangle, float u, float v) {
  const Eigen::Vector3i& t = (*mesh.triangles)[triangle];
  const Eigen::Vector3f &p0 = mesh.points[t[0]], &p1 = mesh.points[t[1]], &p2 = mesh.points[t[2]];
  const auto cross = [](float ax, float ay, float bx, float by) { return ax * by - ay * bx; };
  Eigen::Vector3f w(cross(p1.x() - u, p1.y() - v, p2.x() - u, p2.y() - v),
                    cross(p2.x() - u, p2.y() - v, p0.x() - u, p0.y() - v),
                    cross(p0.x() - u, p0.y() - v, p1.x() - u, p1.y() - v));
  if (w.sum() < 0.0f) w = -w;
  w = w.cwiseMax(0.0f);
  // Weights in space from weights in the picture: divide by depth and normalise.
  w = w.cwiseProduct(Eigen::Vector3f(p0.z(), p1.z(), p2.z()));
  const float sum = w.sum();
  return sum > 0.0f ? Eigen::Vector3f(w / sum) : Eigen::Vector3f::Constant(1.0f / 3.0f);
}

}  // namespace calipso::render
