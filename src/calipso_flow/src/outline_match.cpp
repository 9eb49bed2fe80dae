#include "calipso_flow/outline_match.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace calipso::flow {
namespace {

constexpr int kReach = 7;                // px on either side of the outline that are looked at
constexpr int kOuter = 3;                // outermost of these show one side only
constexpr double kStep = 0.5;            // px between samples across the outline
constexpr int kHalfLength = 3;           // px along the outline that are averaged
constexpr double kSpacing = 8.0;         // px between points of the outline
constexpr double kLeastContrast = 12.0;  // grey levels between the two sides
constexpr double kAlongPx = 1e3;         // deviation along the outline: nothing is known
constexpr int kBiasRounds = 5;
constexpr double kUsualBias = 0.3;  // px
constexpr double kInside = 3.0;     // px within the outline that the object's look is taken from

struct OutlinePoint {
  Eigen::Vector3d rest;  // object frame
  Eigen::Vector2d pixel;
  Eigen::Vector2d outward;  // unit, in the picture
};

bool bilinear(const cv::Mat& image, const Eigen::Vector2d& at, double& value) {
  const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
  if (x < 0 || y < 0 || x + 1 >= image.cols || y + 1 >= image.rows) return false;
  const double fx = at.x() - x, fy = at.y() - y;
  const float* top = image.ptr<float>(y) + x;
  const float* bottom = image.ptr<float>(y + 1) + x;
  value =
      (1 - fy) * ((1 - fx) * top[0] + fx * top[1]) + fy * ((1 - fx) * bottom[0] + fx * bottom[1]);
  return true;
}

// Edges between a triangle that faces the camera and one that does not, or none.
std::vector<SurfaceEdge> silhouetteEdges(const std::vector<SurfaceEdge>& edges,
                                         const TriangleMesh& mesh,
                                         const std::vector<Eigen::Vector2d>& pixels,
                                         const std::vector<bool>& usable) {
  std::vector<int> facing(mesh.triangleCount(), 0);  // +1 front, -1 back, 0: not to be used
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3i c = mesh.triangles.row(t).transpose();
    if (!usable[c[0]] || !usable[c[1]] || !usable[c[2]]) continue;
    const Eigen::Vector2d a = pixels[c[1]] - pixels[c[0]], b = pixels[c[2]] - pixels[c[0]];
    facing[t] = a.x() * b.y() - a.y() * b.x() < 0.0 ? 1 : -1;
  }
  std::vector<SurfaceEdge> silhouette;
  for (const SurfaceEdge& edge : edges) {
    const int left = edge.left < 0 ? 0 : facing[edge.left];
    const int right = edge.right < 0 ? 0 : facing[edge.right];
    if (left != right) silhouette.push_back(edge);
  }
  return silhouette;
}

bool covered(const ReferenceView::Warped& look, const Eigen::Vector2d& at) {
  const cv::Point p(cvRound(at.x() - look.gray.origin.x), cvRound(at.y() - look.gray.origin.y));
  return cv::Rect({0, 0}, look.covered.size()).contains(p) && look.covered.at<uchar>(p) != 0;
}

// The side of the edge that the surface does not cover; nothing where both sides are alike.
std::optional<Eigen::Vector2d> outwardOf(const ReferenceView::Warped& look,
                                         const Eigen::Vector2d& at, const Eigen::Vector2d& along) {
  const Eigen::Vector2d across(-along.y(), along.x());
  bool one = true, other = true;  // clear of the surface all the way
  for (double s = 2.0; s <= kReach; s += 1.0) {
    one = one && !covered(look, at + s * across);
    other = other && !covered(look, at - s * across);
  }
  const bool one_inside = covered(look, at + kInside * across);
  const bool other_inside = covered(look, at - kInside * across);
  if (one && other_inside) return across;
  if (other && one_inside) return Eigen::Vector2d(-across);
  return std::nullopt;
}

std::vector<OutlinePoint> outlinePoints(const std::vector<SurfaceEdge>& edges,
                                        const TriangleMesh& mesh,
                                        const decltype(TriangleMesh::vertices)& deformed,
                                        const ReferenceView::Warped& look, const Camera& camera,
                                        const Eigen::Isometry3d& camera_from_object) {
  std::vector<Eigen::Vector2d> pixels(mesh.vertexCount());
  std::vector<bool> usable(mesh.vertexCount());
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const Eigen::Vector3d p = camera_from_object * deformed.row(i).transpose();
    usable[i] = p.z() > 0.0;
    if (usable[i]) pixels[i] = camera.project(p);
  }
  std::vector<OutlinePoint> points;
  std::map<std::pair<int, int>, bool> taken;  // cells of the picture that have their point
  for (const SurfaceEdge& border : silhouetteEdges(edges, mesh, pixels, usable)) {
    const int i = border.from, j = border.to;
    const Eigen::Vector2d at = 0.5 * (pixels[i] + pixels[j]), edge = pixels[j] - pixels[i];
    if (!(edge.norm() > 1e-6)) continue;
    bool& cell = taken[{static_cast<int>(at.x() / kSpacing), static_cast<int>(at.y() / kSpacing)}];
    if (cell) continue;
    const auto outward = outwardOf(look, at, edge.normalized());
    if (!outward) continue;
    cell = true;
    points.push_back({0.5 * (mesh.vertex(i) + mesh.vertex(j)), at, *outward});
  }
  return points;
}

// Means over a short stretch along the outline, from inside to outside; false at the picture's
// edge.
bool profile(const cv::Mat& gray, const OutlinePoint& point, std::vector<double>& values) {
  const Eigen::Vector2d along(-point.outward.y(), point.outward.x());
  values.clear();
  for (double s = -kReach; s <= kReach; s += kStep) {
    double sum = 0.0;
    for (int a = -kHalfLength; a <= kHalfLength; ++a) {
      double value = 0.0;
      if (!bilinear(gray, point.pixel + s * point.outward + a * along, value)) return false;
      sum += value;
    }
    values.push_back(sum / (2 * kHalfLength + 1));
  }
  return true;
}

// Mean and variance of values[first, last).
std::pair<double, double> moments(const std::vector<double>& values, int first, int last) {
  double sum = 0.0, squares = 0.0;
  for (int i = first; i < last; ++i) sum += values[i], squares += values[i] * values[i];
  const double mean = sum / (last - first);
  return {mean, std::max(0.0, squares / (last - first) - mean * mean)};
}

// Position of the step along the outward direction, px, and its variance.
std::optional<std::pair<double, double>> locateStep(const std::vector<double>& values) {
  const int count = static_cast<int>(values.size()), side = static_cast<int>(kOuter / kStep);
  const auto [inside, inner_variance] = moments(values, 0, side);
  const auto [outside, outer_variance] = moments(values, count - side, count);
  const double contrast = inside - outside;
  if (std::abs(contrast) < kLeastContrast) return std::nullopt;
  // The area under the share of the object's colour is the way to the step.
  double area = 0.0;
  for (const double value : values) {
    area += kStep * std::clamp((value - outside) / contrast, 0.0, 1.0);
  }
  const double position = area - kReach - 0.5 * kStep;
  if (std::abs(position) > kReach - kOuter) return std::nullopt;
  // Texture on either side moves the area by about its share of the contrast over half the window.
  const double unrest = (inner_variance + outer_variance) / (contrast * contrast);
  return std::make_pair(position, 0.25 * 0.25 + unrest * kReach);
}

}  // namespace

std::vector<SurfaceEdge> edgesOf(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, std::vector<int>> beside;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    for (int e = 0; e < 3; ++e) {
      beside[std::minmax({mesh.triangles(t, e), mesh.triangles(t, (e + 1) % 3)})].push_back(t);
    }
  }
  std::vector<SurfaceEdge> edges;
  for (const auto& [edge, triangles] : beside) {
    if (triangles.size() > 2) continue;
    edges.push_back(
        {edge.first, edge.second, triangles[0], triangles.size() == 2 ? triangles[1] : -1});
  }
  return edges;
}

SurfaceMatch OutlineStep::match(double expected) const {
  const Eigen::Vector2d along(-outward.y(), outward.x());
  return {
      rest, pixel + (distance - expected) * outward,
      variance * outward * outward.transpose() + kAlongPx * kAlongPx * along * along.transpose()};
}

std::vector<OutlineStep> findOutline(const std::vector<SurfaceEdge>& edges,
                                     const TriangleMesh& mesh,
                                     const decltype(TriangleMesh::vertices)& deformed,
                                     const ReferenceView::Warped& look, const Frame& frame,
                                     const Eigen::Isometry3d& world_from_object) {
  const Eigen::Isometry3d camera_from_object =
      frame.camera.world_from_camera.inverse() * world_from_object;
  std::vector<OutlineStep> steps;
  std::vector<double> values;
  for (const OutlinePoint& point :
       outlinePoints(edges, mesh, deformed, look, frame.camera, camera_from_object)) {
    if (!profile(frame.gray, point, values)) continue;
    const auto step = locateStep(values);
    if (step) steps.push_back({point.rest, point.pixel, point.outward, step->first, step->second});
  }
  return steps;
}

OutlineBias::OutlineBias(const std::vector<OutlineStep>& steps) {
  for (int round = 0; round < kBiasRounds; ++round) {
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    // Around zero, unless the steps say otherwise.
    matrix.diagonal().setConstant(1.0 / (kUsualBias * kUsualBias));
    for (const OutlineStep& step : steps) {
      const Eigen::Vector3d basis(1.0, step.outward.x(), step.outward.y());
      const double off = step.distance - towards(step.outward);
      const double weight = 1.0 / (step.variance + off * off);  // Cauchy's
      matrix += weight * basis * basis.transpose(), right += weight * step.distance * basis;
    }
    harmonics_ = matrix.ldlt().solve(right);
  }
}

double OutlineBias::towards(const Eigen::Vector2d& outward) const {
  return harmonics_.dot(Eigen::Vector3d(1.0, outward.x(), outward.y()));
}

}  // namespace calipso::flow
