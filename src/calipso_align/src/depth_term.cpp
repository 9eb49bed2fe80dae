#include "calipso_align/depth_term.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_scene/median.hpp"

namespace calipso::align {
namespace {

double areaOf(const Points& x, const Triangles& triangles, int face) {
  const Eigen::Vector3d a = x.row(triangles(face, 0)), b = x.row(triangles(face, 1)),
                        c = x.row(triangles(face, 2));
  return 0.5 * (b - a).cross(c - a).norm();
}

// Depth observed where a point of the model is seen, against the plane of its face; nothing where
// it is hidden or nothing is known there.
std::optional<PointRow> depthRow(const DepthTarget& target, const DepthRendering& rendering,
                                 const Camera& camera, const Points& x, const Triangles& triangles,
                                 const SurfacePoint& point) {
  constexpr double kLeastFacing = 0.25;  // cosine to the sight line; grazing surfaces tell little
  constexpr double kHiddenPx = 0.5;      // what lies so far behind what is drawn is not seen
  const std::array<int, 3> v = {triangles(point.face, 0), triangles(point.face, 1),
                                triangles(point.face, 2)};
  const Eigen::Vector3d a = x.row(v[0]), b = x.row(v[1]), c = x.row(v[2]);
  const Eigen::Vector3d normal = (b - a).cross(c - a).stableNormalized();
  const Eigen::Vector3d p = point.weights[0] * a + point.weights[1] * b + point.weights[2] * c;
  if (p.z() <= 0.0 || std::abs(normal.dot(p.normalized())) < kLeastFacing) return std::nullopt;
  const Eigen::Vector2d pixel = camera.project(p);
  const cv::Point at(cvRound(pixel.x()), cvRound(pixel.y()));
  const float drawn = rendering.at(at.x, at.y);
  if (drawn <= 0.0f || target.depth(at) <= 0.0f) return std::nullopt;
  // The pixel's own sight line, which passes the point by.
  const Eigen::Vector3d ray = camera.ray(at.x, at.y);
  const double z = normal.dot(p) / normal.dot(ray);
  if (z > drawn + kHiddenPx * p.z() / camera.fx) return std::nullopt;
  return PointRow{v, point.weights, normal, normal.dot(p - target.depth(at) * ray), 1.0};
}

}  // namespace

std::vector<SurfacePoint> spreadOver(const Points& x, const Triangles& triangles) {
  constexpr int kCount = 3000;  // no more than a depth image can tell apart by far
  constexpr double kPlastic = 1.32471795724474602596;
  double total = 0.0, passed = 0.0;
  for (int f = 0; f < triangles.rows(); ++f) total += areaOf(x, triangles, f);
  std::vector<SurfacePoint> points;
  for (int f = 0; f < triangles.rows(); ++f) {
    passed += areaOf(x, triangles, f);
    while ((points.size() + 0.5) * total < passed * kCount) {
      // Multiples of the powers of 1 / kPlastic are spread over the unit square (Roberts 2018).
      const double k = static_cast<double>(points.size());
      double s = std::fmod(k / kPlastic, 1.0), t = std::fmod(k / (kPlastic * kPlastic), 1.0);
      if (s + t > 1.0) s = 1.0 - s, t = 1.0 - t;
      points.push_back({f, {1.0 - s - t, s, t}});
    }
  }
  return points;
}

DepthTarget makeDepthTarget(const cv::Mat1f& depth, const cv::Mat1b& silhouette) {
  cv::Mat1b inner;
  cv::erode(silhouette, inner, cv::getStructuringElement(cv::MORPH_RECT, {5, 5}));
  DepthTarget target;
  target.depth = cv::Mat1f::zeros(depth.size());
  std::vector<double> values;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float d = depth(v, u);
      if (!inner(v, u) || !std::isfinite(d) || d <= 0.0f) continue;
      target.depth(v, u) = d;
      values.push_back(d);
    }
  }
  if (values.empty()) return {};
  target.quantum = 1e-3 * median(values);
  return target;
}

Rows depthRows(const DepthTarget& target, const Points& x, const Triangles& triangles,
               const std::vector<SurfacePoint>& points, const DepthRendering& rendering,
               const Camera& camera, const DepthTermOptions& options) {
  Rows rows;
  if (target.empty() || rendering.roi.empty()) return rows;
  for (const SurfacePoint& point : points) {
    const auto row = depthRow(target, rendering, camera, x, triangles, point);
    if (row) rows.push_back(*row);
  }
  if (rows.empty()) return rows;

  std::vector<double> sizes;
  for (const PointRow& row : rows) sizes.push_back(std::abs(row.r));
  const double deviation =
      std::clamp(1.4826 * median(sizes), std::max(options.sigma, target.quantum), options.robust);
  const double information = std::min(1.0, options.samples / rows.size()) / (deviation * deviation);
  for (PointRow& row : rows) row.weight = information * gemanMcClure(row.r, options.robust);
  return rows;
}

double medianDepthOffset(const DepthTarget& target, const DepthRendering& rendering) {
  std::vector<double> offsets;
  const cv::Rect& roi = rendering.roi;
  for (int v = roi.y; v < roi.y + roi.height && !target.empty(); ++v) {
    for (int u = roi.x; u < roi.x + roi.width; ++u) {
      const float rendered = rendering.at(u, v), observed = target.depth(v, u);
      if (rendered > 0.0f && observed > 0.0f) offsets.push_back(observed - rendered);
    }
  }
  return offsets.empty() ? 0.0 : median(offsets);
}

}  // namespace calipso::align
