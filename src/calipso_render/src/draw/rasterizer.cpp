#include "calipso_render/rasterizer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "draw/kernels.hpp"
#include "draw/triangle_span.hpp"

namespace calipso::render {
namespace {

constexpr double kNearPlane = 1e-6;       // m in front of the camera
constexpr std::size_t kFewPoints = 4096;  // not worth sharing out

constexpr int kBandRows = 32;
constexpr int kPartTriangles = 640;

// Some of a mesh's triangles: their spans, by the bands of rows that they reach.
struct Part {
  const ScreenMesh* mesh;
  int begin, end;       // triangles
  std::uint32_t label;  // the object's, in ids

  std::unique_ptr<TriangleSpan[]> spans;
  int count = 0;
  std::vector<int> sorted;  // numbers of spans, ascending in each band
  std::vector<int> first;   // per band: its first in `sorted`, and one more

  void makeSpans(const cv::Rect& region) {
    spans.reset(new TriangleSpan[end - begin]);
    count = kernels().makeSpans(*mesh, begin, end, label, region, spans.get());
  }

  void sort(int bands) {
    first.assign(bands + 2, 0);
    for (int i = 0; i < count; ++i) {
      for (int band = spans[i].row_min / kBandRows; band <= spans[i].row_max / kBandRows; ++band)
        ++first[band + 2];
    }
    for (int band = 2; band <= bands; ++band) first[band + 1] += first[band];
    sorted.resize(first.back());
    for (int i = 0; i < count; ++i) {
      for (int band = spans[i].row_min / kBandRows; band <= spans[i].row_max / kBandRows; ++band)
        sorted[first[band + 1]++] = i;
    }
  }
};

// Adds the mesh's parts, in the order of its triangles.
void split(const ScreenMesh& mesh, std::size_t object, std::vector<Part>& parts) {
  const int count = static_cast<int>(mesh.triangles->size());
  for (int begin = 0; begin < count; begin += kPartTriangles) {
    parts.push_back({&mesh,
                     begin,
                     std::min(begin + kPartTriangles, count),
                     static_cast<std::uint32_t>(object) << 24,
                     nullptr,
                     0,
                     {},
                     {}});
  }
}

void clear(const SpanTarget& target) {
  const std::size_t first = static_cast<std::size_t>(target.first) * target.stride,
                    count = static_cast<std::size_t>(target.last + 1) * target.stride - first;
  if (target.ids != nullptr) std::fill_n(target.ids + first, count, VisibilityBuffer::kNothing);
  std::fill_n(target.nearness + first, count, VisibilityBuffer::kFar);
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

std::vector<const ScreenMesh*> pointersTo(const std::vector<ScreenMesh>& meshes) {
  std::vector<const ScreenMesh*> all;
  for (const ScreenMesh& mesh : meshes) all.push_back(&mesh);
  return all;
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

VisibilityBuffer::VisibilityBuffer(const cv::Rect& region,
                                   const std::vector<const ScreenMesh*>& meshes, bool with_ids)
    : region_(region),
      stride_(region.width + kPadding),
      ids_(with_ids ? new std::uint32_t[static_cast<std::size_t>(stride_) * region.height]
                    : nullptr),
      near_(new float[static_cast<std::size_t>(stride_) * region.height]) {
  const int bands = (region.height + kBandRows - 1) / kBandRows;
  std::vector<Part> parts;
  for (std::size_t k = 0; k < meshes.size(); ++k) split(*meshes[k], k, parts);
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (Part& part : parts) {
      part.makeSpans(region);
      part.sort(bands);
    }
#pragma omp for schedule(dynamic, 1)
    for (int band = 0; band < bands; ++band) {
      const SpanTarget target{ids_.get(), near_.get(), stride_, band * kBandRows,
                              std::min((band + 1) * kBandRows, region.height) - 1};
      clear(target);
      for (const Part& part : parts) {
        kernels().fill(part.spans.get(), &part.sorted[part.first[band]],
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
