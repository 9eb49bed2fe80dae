#include "calipso_align/depth_term.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_scene/median.hpp"

namespace calipso::align {
namespace {

constexpr double kLeastFacing = 0.25;  // cosine to the sight line; grazing surfaces tell little

// Vertices to measure at, no more than the depth image can tell apart by far: spread over the mesh
// whatever pattern its order follows, as multiples of the golden ratio are over the unit interval.
std::vector<int> spreadVertices(int count) {
  constexpr int kMost = 3000;
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0), share = static_cast<double>(kMost) / count;
  std::vector<int> chosen;
  for (int i = 0; i < count; ++i) {
    const double at = i * golden;
    if (at - std::floor(at) < share) chosen.push_back(i);
  }
  return chosen;
}

// As long as the faces around are large.
Points vertexNormals(const Points& x, const Triangles& triangles) {
  Points normals = Points::Zero(x.rows(), 3);
  for (int f = 0; f < triangles.rows(); ++f) {
    const Eigen::Vector3d a = x.row(triangles(f, 0)), b = x.row(triangles(f, 1)),
                          c = x.row(triangles(f, 2));
    const Eigen::RowVector3d n = (b - a).cross(c - a).transpose();
    for (int k = 0; k < 3; ++k) normals.row(triangles(f, k)) += n;
  }
  return normals;
}

// Observed depth under a vertex that the camera sees from its front; 0 for all others.
float observedDepth(const DepthTarget& target, const DepthRendering& rendering,
                    const Camera& camera, const Eigen::Vector3d& p, const Eigen::Vector3d& normal,
                    double tolerance) {
  if (p.z() <= 0.0 || -normal.dot(p.normalized()) < kLeastFacing) return 0.0f;
  const Eigen::Vector2d pixel = camera.project(p);
  const cv::Point at(cvRound(pixel.x()), cvRound(pixel.y()));
  if (!rendering.roi.contains(at)) return 0.0f;
  const float rendered = rendering.at(at.x, at.y);
  if (rendered <= 0.0f || p.z() > rendered + tolerance) return 0.0f;
  return target.depth(at);
}

}  // namespace

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
               const DepthRendering& rendering, const Camera& camera,
               const DepthTermOptions& options) {
  Rows rows;
  if (target.empty() || rendering.roi.empty()) return rows;
  const Points normals = vertexNormals(x, triangles);
  for (const int i : spreadVertices(static_cast<int>(x.rows()))) {
    const Eigen::Vector3d p = x.row(i), n = normals.row(i).stableNormalized();
    const float observed = observedDepth(target, rendering, camera, p, n, options.robust);
    if (observed <= 0.0f) continue;
    // The observed point on the vertex' own sight line.
    const Eigen::Vector3d q = p * (observed / p.z());
    rows.push_back({i, i, 1.0, 0.0, n, n.dot(p - q), 1.0});
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
