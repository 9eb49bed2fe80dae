#include "calipso_align/metrics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "calipso_align/contour_term.hpp"
#include "calipso_align/surface_distance.hpp"

namespace calipso::align {
namespace {

// Distance of p to the polygon's nearest segment.
double distanceToLoops(const Eigen::Vector2d& p, const std::vector<ContourLoop>& loops,
                       bool& known) {
  double best = std::numeric_limits<double>::max();
  for (const ContourLoop& loop : loops) {
    const size_t n = loop.points.size();
    for (size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d& a = loop.points[i];
      const Eigen::Vector2d ab = loop.points[(i + 1) % n] - a;
      const double t = std::clamp(ab.dot(p - a) / std::max(ab.squaredNorm(), 1e-12), 0.0, 1.0);
      const double distance = (a + t * ab - p).norm();
      if (distance < best) {
        best = distance;
        known = loop.known[i];
      }
    }
  }
  return best;
}

double distanceToOutline(const Eigen::Vector2d& p, const std::vector<OutlinePoint>& outline) {
  double best = std::numeric_limits<double>::max();
  for (const OutlinePoint& q : outline) best = std::min(best, (q.pixel - p).squaredNorm());
  return std::sqrt(best);
}

// Distances both ways between the known contour and outline samples.
ContourError errorBetween(const std::vector<ContourLoop>& contour,
                          const std::vector<OutlinePoint>& outline) {
  constexpr double kSpacingPx = 1.0;  // of the contour's samples
  if (outline.empty()) return {1e9, 1e9};
  std::vector<double> errors;
  for (const ContourLoop& loop : contour) {
    Eigen::Vector2d last(-1e9, -1e9);
    for (size_t i = 0; i < loop.points.size(); ++i) {
      if (!loop.known[i] || (loop.points[i] - last).norm() < kSpacingPx) continue;
      last = loop.points[i];
      errors.push_back(distanceToOutline(last, outline));
    }
  }
  for (size_t k = 0; k < outline.size(); k += 4) {
    bool known = false;
    const double distance = distanceToLoops(outline[k].pixel, contour, known);
    if (known) errors.push_back(distance);
  }
  if (errors.empty()) return {1e9, 1e9};
  ContourError error;
  error.mean_px = std::accumulate(errors.begin(), errors.end(), 0.0) / errors.size();
  const auto p95 = errors.begin() + static_cast<long>(0.95 * (errors.size() - 1));
  std::nth_element(errors.begin(), p95, errors.end());
  error.p95_px = *p95;
  return error;
}

constexpr double kOutlineStepPx = 0.25;  // an eighth of a pixel at most is added

// 255 where the background is joined to the picture's border.
cv::Mat1b openBackground(const cv::Mat1b& mask) {
  constexpr uchar kOpen = 128;
  cv::Mat1b padded;
  cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::floodFill(padded, cv::Point(0, 0), cv::Scalar(kOpen));
  return padded == kOpen;
}

}  // namespace

ContourError contourError(const std::vector<ContourLoop>& contour, const Points& x,
                          const MeshTopology& topology, const Camera& camera) {
  const DepthRendering rendering = renderDepth(x, topology, camera);
  return errorBetween(contour, occludingContour(x, topology, rendering, camera, kOutlineStepPx));
}

ContourError hullError(const std::vector<ContourLoop>& contour, const Points& x,
                       const MeshTopology& topology, const Camera& camera) {
  const DepthRendering rendering = renderDepth(x, topology, camera);
  const cv::Mat1b open = openBackground(maskOf(rendering, camera));
  std::vector<OutlinePoint> hull;
  for (const OutlinePoint& p : occludingContour(x, topology, rendering, camera, kOutlineStepPx)) {
    const Eigen::Vector2d beyond = p.pixel + p.normal;
    const cv::Point at(static_cast<int>(std::lround(beyond.x())) + 1,
                       static_cast<int>(std::lround(beyond.y())) + 1);
    if (cv::Rect({}, open.size()).contains(at) && open(at)) hull.push_back(p);
  }
  std::vector<ContourLoop> outer;
  for (const ContourLoop& loop : contour) {
    if (!loop.hole) outer.push_back(loop);
  }
  return errorBetween(outer, hull);
}

SurfaceError surfaceError(const Points& a, const Points& b, const Triangles& triangles_a,
                          const Triangles& triangles_b) {
  const std::vector<double> ab = distancesToSurface(a, b, triangles_b),
                            ba = distancesToSurface(b, a, triangles_a);
  SurfaceError error;
  for (const std::vector<double>* side : {&ab, &ba}) {
    for (const double d : *side) {
      error.mean += 0.5 * d / side->size();
      error.rms += 0.5 * d * d / side->size();
      error.hausdorff = std::max(error.hausdorff, d);
    }
  }
  error.rms = std::sqrt(error.rms);
  return error;
}

double reprojectionError(const Points& x, const Points& truth, const Camera& camera,
                         const std::vector<int>& vertices) {
  double sum = 0.0;
  int count = 0;
  for (const int i : vertices) {
    if (x(i, 2) <= 0.0 || truth(i, 2) <= 0.0) continue;
    sum += (camera.project(x.row(i).transpose()) - camera.project(truth.row(i).transpose())).norm();
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

double depthGauge(const Points& x, const Points& truth) {
  return truth.col(2).mean() / x.col(2).mean();
}

double intersectionOverUnion(const cv::Mat1b& a, const cv::Mat1b& b) {
  const int both = cv::countNonZero(a & b), either = cv::countNonZero(a | b);
  return either > 0 ? static_cast<double>(both) / either : 1.0;
}

}  // namespace calipso::align
