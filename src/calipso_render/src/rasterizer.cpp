#include "calipso_render/rasterizer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::render {
namespace {

constexpr double kNearPlane = 1e-6;     // m in front of the camera
constexpr int kBands = 8;               // rows are split in fixed bands: the result knows no thread count
constexpr float kEdgeTolerance = 1e-3f; // px; shared edges belong to both sides, so no cracks
constexpr float kSmallestArea = 1e-9f;  // px^2

// Without SSE 4.1 std::floor and std::ceil are calls; |x| must fit an int.
int floorInt(float x) {
  const int i = static_cast<int>(x);
  return i - (static_cast<float>(i) > x);
}
int ceilInt(float x) {
  const int i = static_cast<int>(x);
  return i + (static_cast<float>(i) < x);
}

// A triangle made ready for row spans. A row v lies inside from the greatest of `left` to the least of `right`, each
// linear in v; nearness is a plane.
struct Span {
  struct Bound {
    float column, row, slope;  // a point of it, and columns per row
    float at(float v) const { return column + slope * (v - row); }
  };
  Bound left[3], right[3];
  int lefts, rights;
  float near_u, near_v, near_0;
  int row_min, row_max, column_min, column_max;  // in the buffer's region
  std::uint32_t id;
};

bool makeSpan(const ScreenMesh& mesh, int triangle, const cv::Rect& region, Span& span) {
  const Eigen::Vector3i& t = (*mesh.triangles)[triangle];
  const Eigen::Vector3f offset(region.x, region.y, 0.0f);
  Eigen::Vector3f p[3];
  for (int i = 0; i < 3; ++i) p[i] = mesh.points[t[i]] - offset;
  const float left = std::min({p[0].x(), p[1].x(), p[2].x()});
  const float right = std::max({p[0].x(), p[1].x(), p[2].x()});
  const float top = std::min({p[0].y(), p[1].y(), p[2].y()});
  const float bottom = std::max({p[0].y(), p[1].y(), p[2].y()});
  // Written so that NaN fails every comparison.
  if (!(right >= 0 && bottom >= 0 && left <= region.width - 1 && top <= region.height - 1)) return false;
  const float area = (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) -
                     (p[2].x() - p[0].x()) * (p[1].y() - p[0].y());
  if (mesh.hides(area) || !(std::abs(area) > kSmallestArea) || std::isnan(p[0].z() + p[1].z() + p[2].z())) return false;
  span.row_min = ceilInt(std::max(0.0f, top - kEdgeTolerance));
  span.row_max = floorInt(std::min(region.height - 1.0f, bottom + kEdgeTolerance));
  span.column_min = ceilInt(std::max(0.0f, left - kEdgeTolerance));
  span.column_max = floorInt(std::min(region.width - 1.0f, right + kEdgeTolerance));
  if (span.row_min > span.row_max || span.column_min > span.column_max) return false;
  span.lefts = span.rights = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f& start = p[(i + 1) % 3];
    const Eigen::Vector3f& end = p[(i + 2) % 3];
    const float dx = end.x() - start.x(), dy = end.y() - start.y();
    if (std::abs(dy) < kEdgeTolerance) continue;  // level: the rows' limits bound it
    // The edge is moved out by kEdgeTolerance: along the row by that times length / |dy|.
    const float slope = dx / dy, reach = kEdgeTolerance * std::sqrt(1.0f + slope * slope);
    const bool is_left = (area > 0.0f) == (dy < 0.0f);
    if (is_left) span.left[span.lefts++] = {start.x() - reach, start.y(), slope};
    else span.right[span.rights++] = {start.x() + reach, start.y(), slope};
  }
  const float dz1 = p[1].z() - p[0].z(), dz2 = p[2].z() - p[0].z();
  span.near_u = (dz1 * (p[2].y() - p[0].y()) - dz2 * (p[1].y() - p[0].y())) / area;
  span.near_v = (dz2 * (p[1].x() - p[0].x()) - dz1 * (p[2].x() - p[0].x())) / area;
  span.near_0 = p[0].z() - span.near_u * p[0].x() - span.near_v * p[0].y();
  return true;
}

// Columns of row v inside the triangle.
void rowLimits(const Span& s, float v, int& from, int& to) {
  float low = static_cast<float>(s.column_min), high = static_cast<float>(s.column_max);
  for (int i = 0; i < s.lefts; ++i) low = std::max(low, s.left[i].at(v));
  for (int i = 0; i < s.rights; ++i) high = std::min(high, s.right[i].at(v));
  if (!(low <= high)) {  // far off, they might not fit an int
    from = 0, to = -1;
    return;
  }
  from = ceilInt(low);
  to = floorInt(high);
}

void fillRow(const Span& s, int row, int from, int to, std::uint32_t* ids, float* nearest) {
  const float base = s.near_0 + s.near_v * row;
  for (int u = from; u <= to; ++u) {
    const float z = base + s.near_u * u;
    const bool closer = z > nearest[u];
    nearest[u] = closer ? z : nearest[u];
    ids[u] = closer ? s.id : ids[u];
  }
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
  for (const Eigen::Vector3f& p : mesh.points) {
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

VisibilityBuffer::VisibilityBuffer(const cv::Rect& region)
    : region_(region), ids_(region.area(), kNothing), near_(region.area(), kFar) {}

void VisibilityBuffer::draw(const ScreenMesh& mesh, int object) {
  const int count = static_cast<int>(mesh.triangles->size());
  std::vector<Span> parts[kBands];  // of the triangles, in their order
#pragma omp parallel for schedule(static)
  for (int part = 0; part < kBands; ++part) {
    const int begin = static_cast<int>(static_cast<long>(count) * part / kBands), end = static_cast<int>(static_cast<long>(count) * (part + 1) / kBands);
    Span span;
    for (int t = begin; t < end; ++t) {
      if (!makeSpan(mesh, t, region_, span)) continue;
      span.id = (static_cast<std::uint32_t>(object) << 24) | static_cast<std::uint32_t>(t);
      if (parts[part].capacity() == 0) parts[part].reserve(end - t);
      parts[part].push_back(span);
    }
  }
#pragma omp parallel for schedule(static)
  for (int band = 0; band < kBands; ++band) {
    const int first = region_.height * band / kBands;
    const int last = region_.height * (band + 1) / kBands - 1;
    for (const std::vector<Span>& part : parts) {
      for (const Span& s : part) {
        for (int row = std::max(first, s.row_min); row <= std::min(last, s.row_max); ++row) {
          int from, to;
          rowLimits(s, static_cast<float>(row), from, to);
          const std::size_t start = static_cast<std::size_t>(row) * region_.width;
          if (from <= to) fillRow(s, row, from, to, &ids_[start], &near_[start]);
        }
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
