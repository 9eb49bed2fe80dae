#include "calipso_render/rasterizer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "draw/eight_lanes.hpp"
#include "draw/kernels.hpp"
#include "draw/triangle_span.hpp"

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

// Edge functions, moved out by kEdgeTolerance. @pre the limits are set
void setEdges(const Eigen::Vector3f (&p)[3], float area, TriangleSpan& span) {
  const FourInts next = {1, 2, 0, 3};
  const Four x = {p[0].x(), p[1].x(), p[2].x(), 0.0f}, y = {p[0].y(), p[1].y(), p[2].y(), 0.0f},
             dx = __builtin_shuffle(x, next) - x, dy = __builtin_shuffle(y, next) - y,
             squared = dx * dx + dy * dy;
  const float inwards = area > 0.0f ? 1.0f : -1.0f;
  const Four across = dx * (static_cast<float>(span.row_min) - y),
             along = dy * (static_cast<float>(span.column_min) - x);
  for (int i = 0; i < 4; ++i) {
    span.edge_u[i] = -inwards * dy[i], span.edge_v[i] = inwards * dx[i];
    span.edge_0[i] = inwards * (across[i] - along[i]) + kEdgeTolerance * std::sqrt(squared[i]);
  }
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
  setEdges(p, area, span);
  const float dz1 = p[1].z() - p[0].z(), dz2 = p[2].z() - p[0].z(), per_area = 1.0f / area;
  span.near_u = (dz1 * (p[2].y() - p[0].y()) - dz2 * (p[1].y() - p[0].y())) * per_area;
  span.near_v = (dz2 * (p[1].x() - p[0].x()) - dz1 * (p[2].x() - p[0].x())) * per_area;
  span.near_0 = p[0].z() - span.near_u * p[0].x() - span.near_v * p[0].y();
  return true;
}

constexpr int kBandRows = 32;

// Spans by the bands of rows that they reach.
struct Part {
  std::vector<TriangleSpan> spans;
  std::vector<int> sorted;  // numbers of spans, ascending in each band
  std::vector<int> first;   // per band: its first in `sorted`, and one more

  void sort(int bands) {
    first.assign(bands + 2, 0);
    for (const TriangleSpan& s : spans) {
      for (int band = s.row_min / kBandRows; band <= s.row_max / kBandRows; ++band)
        ++first[band + 2];
    }
    for (int band = 2; band <= bands; ++band) first[band + 1] += first[band];
    sorted.resize(first.back());
    for (std::size_t i = 0; i < spans.size(); ++i) {
      for (int band = spans[i].row_min / kBandRows; band <= spans[i].row_max / kBandRows; ++band)
        sorted[first[band + 1]++] = static_cast<int>(i);
    }
  }
};

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
  const int count = static_cast<int>(mesh.triangles->size()),
            bands = (region_.height + kBandRows - 1) / kBandRows;
  Part parts[kParts];  // of the triangles, in their order
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (int k = 0; k < kParts; ++k) {
      const int begin = static_cast<int>(static_cast<long>(count) * k / kParts),
                end = static_cast<int>(static_cast<long>(count) * (k + 1) / kParts);
      std::vector<TriangleSpan>& spans = parts[k].spans;
      spans.reserve(end - begin);
      TriangleSpan span;
      for (int t = begin; t < end; ++t) {
        span.id = (static_cast<std::uint32_t>(object) << 24) | static_cast<std::uint32_t>(t);
        if (makeSpan(mesh, t, region_, span)) spans.push_back(span);
      }
      parts[k].sort(bands);
    }
#pragma omp for schedule(dynamic, 1)
    for (int band = 0; band < bands; ++band) {
      const SpanTarget target{ids_.get(), near_.get(), stride_, band * kBandRows,
                              std::min((band + 1) * kBandRows, region_.height) - 1};
      for (const Part& part : parts) {
        kernels().fill(part.spans.data(), &part.sorted[part.first[band]],
                       part.first[band + 1] - part.first[band], target);
      }
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
