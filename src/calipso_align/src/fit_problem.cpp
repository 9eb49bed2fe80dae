#include "calipso_align/fit_problem.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace calipso::align {
namespace {

void checkMesh(const TriangleMesh& cad) {
  if (cad.vertexCount() < 4 || cad.triangleCount() < 4) {
    throw std::invalid_argument("the model has " + std::to_string(cad.vertexCount()) +
                                " vertices and " + std::to_string(cad.triangleCount()) +
                                " triangles: a solid needs at least 4 of both");
  }
  if (!cad.vertices.allFinite()) {
    throw std::invalid_argument("the model has a vertex that is not a finite number");
  }
  if (cad.triangles.minCoeff() < 0 || cad.triangles.maxCoeff() >= cad.vertexCount()) {
    throw std::invalid_argument("the model's triangles name vertices outside of 0 .. " +
                                std::to_string(cad.vertexCount() - 1));
  }
  if (!(boundingDiagonal(cad) > 0.0)) {
    throw std::invalid_argument("all vertices of the model coincide");
  }
}

void checkCamera(const Camera& camera) {
  if (camera.width <= 0 || camera.height <= 0 || !(camera.fx > 0.0) || !(camera.fy > 0.0) ||
      !std::isfinite(camera.cx) || !std::isfinite(camera.cy)) {
    throw std::invalid_argument(
        "the camera is not calibrated: width, height, fx and fy must be positive (" +
        std::to_string(camera.width) + ", " + std::to_string(camera.height) + ", " +
        std::to_string(camera.fx) + ", " + std::to_string(camera.fy) + ")");
  }
}

void checkPose(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d R = pose.linear();
  if (!pose.matrix().allFinite() || !(R * R.transpose()).isIdentity(1e-3) ||
      R.determinant() < 0.0) {
    throw std::invalid_argument(
        "the rough placement is not a rotation and a translation: give a proper rigid motion");
  }
}

double extentOf(const ContourTarget& target) {
  Eigen::Vector2d low = target.points.front().pixel, high = low;
  for (const TargetPoint& p : target.points) {
    low = low.cwiseMin(p.pixel);
    high = high.cwiseMax(p.pixel);
  }
  return (high - low).norm();
}

// Close enough for the shape, far enough apart for the time.
ContourTarget targetOf(const std::vector<ContourLoop>& contour) {
  constexpr double kFinestSpacingPx = 1.5, kTargetPoints = 500.0, kCoarseSpacingPx = 50.0;
  // The length without its noise, which makes the polygon itself many times as long.
  const double length = makeContourTarget(contour, kCoarseSpacingPx).length_px;
  return makeContourTarget(contour, std::max(kFinestSpacingPx, length / kTargetPoints));
}

void checkDepth(const cv::Mat1f& depth, const Camera& camera) {
  if (depth.cols == camera.width && depth.rows == camera.height) return;
  throw std::invalid_argument("the depth image is " + std::to_string(depth.cols) + "x" +
                              std::to_string(depth.rows) + ", the camera's pictures are " +
                              std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                              ": register the depth with the picture");
}

// The model moved across the view until the middle of what the picture shows of it is where the
// contour's is.
Points beforeContour(const FitProblem& problem) {
  const cv::Rect wanted = cv::boundingRect(problem.inside),
                 seen = boundsOf(renderDepth(problem.X, problem.topology, problem.camera));
  if (seen.empty() || wanted.empty()) return problem.X;
  const cv::Point2d pixels = 0.5 * cv::Point2d(wanted.tl() + wanted.br() - seen.tl() - seen.br());
  const double z = problem.X.col(2).mean();
  return problem.X.rowwise() + Eigen::RowVector3d(pixels.x * z / problem.camera.fx,
                                                  pixels.y * z / problem.camera.fy, 0.0);
}

// Whether the depth image can be compared with what is seen of the model at all.
bool measuresDepth(const FitProblem& problem) {
  const Points x = beforeContour(problem);
  return !depthRows(problem.depth, x, problem.topology.triangles(), problem.surface,
                    renderDepth(x, problem.topology, problem.camera), problem.camera,
                    {problem.model_size})
              .empty();
}

// Whether the rough placement may have the object on the plane: along the view it may be off by a
// twentieth of the distance, and it may be turned by some degrees.
bool standsOn(const SupportTarget& support, const FitProblem& problem) {
  constexpr double kPlacementError = 0.06, kTurned = 0.09;  // of the distance, of the size
  const Points x = beforeContour(problem);
  const std::optional<double> height = clearance(support, x, problem.camera);
  const Eigen::Vector3d middle = x.colwise().mean().transpose();
  const double along = std::abs(support.normal.dot(middle.normalized())) * middle.z();
  return height && std::abs(*height) < kPlacementError * along + kTurned * problem.model_size;
}

// 1 / depth at a pixel; 0 where it is unknown or far away.
double inverseDepth(const cv::Mat1f& depth, const Eigen::Vector2d& p) {
  const cv::Point pixel(static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
  if (!cv::Rect({}, depth.size()).contains(pixel)) return 0.0;
  const float d = depth(pixel);
  return std::isfinite(d) && d > 0.0f ? 1.0 / d : 0.0;
}

// From now on the point may be met, but pulls nobody towards the inside.
void makeUnknown(TargetPoint& p, ContourTarget& target) {
  if (!p.known) return;
  p.known = false;
  p.weight = 0.0;
  target.known_length_px -= target.length_px / target.points.size();
}

// Mask without what is narrower than 2 radius + 1 pixels.
cv::Mat1b opened(const cv::Mat1b& mask, int radius) {
  cv::Mat1b result;
  const cv::Size size(2 * radius + 1, 2 * radius + 1);
  cv::morphologyEx(mask, result, cv::MORPH_OPEN,
                   cv::getStructuringElement(cv::MORPH_ELLIPSE, size));
  return result;
}

// Largest radius of an opening that leaves the model's silhouette as it is, give or take its
// corners.
int narrowestRadius(const cv::Mat1b& silhouette) {
  constexpr int kLargest = 4;
  constexpr double kCorners = 0.003;  // of the area
  const double area = cv::countNonZero(silhouette);
  for (int radius = kLargest; radius > 0; --radius) {
    if (cv::countNonZero(opened(silhouette, radius)) >= (1.0 - kCorners) * area) return radius;
  }
  return 0;
}

// Spurs of the contour that are narrower than anything the model has are no part of it: what hides
// the object or lies behind it was taken in.
void markSpurs(FitProblem& problem) {
  constexpr double kInsidePx = 0.75;
  const Camera& camera = problem.camera;
  const cv::Mat1b silhouette = maskOf(renderDepth(problem.X, problem.topology, camera), camera);
  const int radius = narrowestRadius(silhouette);
  if (radius == 0 || cv::countNonZero(silhouette) == 0) return;
  // A margin that continues the mask: the border of the picture makes nothing narrow.
  cv::Mat1b inside;
  cv::copyMakeBorder(problem.inside, inside, radius, radius, radius, radius, cv::BORDER_REPLICATE);
  const cv::Mat1b spurs = inside & ~opened(inside, radius);
  problem.foreign =
      spurs(cv::Rect(radius, radius, problem.inside.cols, problem.inside.rows)).clone();
  for (TargetPoint& p : problem.target.points) {
    const Eigen::Vector2d within = p.pixel - kInsidePx * p.normal;
    const cv::Point at(static_cast<int>(std::lround(within.x())) + radius,
                       static_cast<int>(std::lround(within.y())) + radius);
    if (!cv::Rect({}, spurs.size()).contains(at) || !spurs(at)) continue;
    makeUnknown(p, problem.target);
    p.foreign = true;
  }
}

// By what part of its depth something has to be nearer than the object to be told from what touches
// it: a twentieth of the object's size, within what depth images can show.
double nearerBy(const FitProblem& problem) {
  constexpr double kOfSize = 0.05, kLeast = 0.01, kMost = 0.05;
  return std::clamp(kOfSize * problem.model_size / problem.X.col(2).mean(), kLeast, kMost);
}

// 1 / depth of a support plane at a pixel.
double inverseDepth(const SupportTarget& support, const Camera& camera, const Eigen::Vector2d& p) {
  const Eigen::Vector3d ray((p.x() - camera.cx) / camera.fx, (p.y() - camera.cy) / camera.fy, 1.0);
  return support.normal.dot(ray) / support.offset;
}

constexpr double kSameDepth = 0.03;  // part of the depth: what is that near a plane lies on it

// What is nearer than most of the object, beside it, and not what it stands on.
cv::Mat1b hidingPixels(const cv::Mat1f& depth, const FitProblem& problem, double nearer_by) {
  std::vector<float> depths;
  for (int v = 0; v < depth.rows; ++v)
    for (int u = 0; u < depth.cols; ++u)
      if (problem.inside(v, u) && std::isfinite(depth(v, u)) && depth(v, u) > 0.0f)
        depths.push_back(depth(v, u));
  if (depths.empty()) return {};
  const auto middle = depths.begin() + depths.size() / 2;
  std::nth_element(depths.begin(), middle, depths.end());
  const double farthest = *middle / (1.0 + nearer_by);
  cv::Mat1b hiding = (depth > 0.0f) & (depth < farthest) & ~problem.inside;
  for (int v = 0; v < depth.rows; ++v)
    for (int u = 0; u < depth.cols; ++u)
      for (const SupportTarget& support : problem.supports)
        if (hiding(v, u) && std::abs(inverseDepth(support, problem.camera, {u, v}) * depth(v, u) -
                                     1.0) < kSameDepth)
          hiding(v, u) = 0;
  return hiding;
}

// Where the surroundings are nearer than the object, the contour is the edge of what hides it. What
// the object stands on is nearer too, but reaches the contour at the object's depth: the inverse
// depth of a plane is linear in the picture.
void markHidden(const cv::Mat1f& depth, double nearer_by, ContourTarget& target) {
  constexpr double kReachPx = 4.0;  // beyond the pixels that mix two surfaces
  for (TargetPoint& p : target.points) {
    const double inside = inverseDepth(depth, p.pixel - kReachPx * p.normal);
    const double near = inverseDepth(depth, p.pixel + kReachPx * p.normal);
    const double far = inverseDepth(depth, p.pixel + 2.0 * kReachPx * p.normal);
    const bool is_hidden =
        inside > 0.0 && std::min(near, 2.0 * near - far) >= (1.0 + nearer_by) * inside;
    if (is_hidden) makeUnknown(p, target);
  }
}

// Where the object meets a support plane it may go on below, as a pier does under water: seen is
// only that it reaches the plane.
void markContacts(const cv::Mat1f& depth, const Camera& camera,
                  const std::vector<SupportTarget>& supports, ContourTarget& target) {
  constexpr double kReachPx = 4.0;
  for (TargetPoint& p : target.points) {
    const double inside = inverseDepth(depth, p.pixel - kReachPx * p.normal);
    for (const SupportTarget& support : supports) {
      const double of_plane = inverseDepth(support, camera, p.pixel);
      if (inside > 0.0 && std::abs(of_plane / inside - 1.0) < kSameDepth) makeUnknown(p, target);
    }
  }
}

}  // namespace

bool FitProblem::depthIsKnown() const {
  const auto stands = [](const SupportTarget& support) { return support.stands; };
  return !depth.empty() || std::any_of(supports.begin(), supports.end(), stands);
}

FitProblem makeFitProblem(const TriangleMesh& cad, const Camera& camera,
                          const Eigen::Isometry3d& initial_world_from_object,
                          const std::vector<ContourLoop>& contour, const AlignOptions& options) {
  checkMesh(cad);
  checkCamera(camera);
  checkPose(initial_world_from_object);

  const Eigen::Isometry3d camera_from_object =
      camera.world_from_camera.inverse() * initial_world_from_object;
  FitProblem problem{transformed(camera_from_object, cad.vertices),
                     MeshTopology(cad.triangles),
                     camera,
                     targetOf(contour),
                     {},
                     {},
                     {},
                     {},
                     {},
                     makeSupportTargets(options.planes, camera),
                     0.0,
                     boundingDiagonal(cad)};
  problem.extent_px = extentOf(problem.target);
  problem.origin = camera_from_object.translation();
  problem.inside = fillTarget(problem.target, contour, {camera.width, camera.height});
  markSpurs(problem);
  if (options.depth) {
    checkDepth(options.depth->depth, camera);
    const double nearer_by = nearerBy(problem);
    problem.hiding = hidingPixels(options.depth->depth, problem, nearer_by);
    markHidden(options.depth->depth, nearer_by, problem.target);
    markContacts(options.depth->depth, camera, problem.supports, problem.target);
    problem.depth = makeDepthTarget(options.depth->depth, problem.inside);
    problem.surface = spreadOver(problem.X, problem.topology.triangles());
    if (!measuresDepth(problem)) problem.depth = {};
  }
  for (SupportTarget& support : problem.supports) {
    support.stands = problem.depth.empty() && standsOn(support, problem);
  }
  return problem;
}

Rows measure(const FitProblem& problem, const Points& x, const MeasureSettings& settings) {
  constexpr double kOutlineStepPx = 2.0;
  const DepthRendering rendering = renderDepth(x, problem.topology, problem.camera);
  Rows rows =
      contourRows(problem.target,
                  occludingContour(x, problem.topology, rendering, problem.camera, kOutlineStepPx),
                  problem.camera, settings.contour);
  const double information = 1.0 / (settings.contour_sigma_px * settings.contour_sigma_px *
                                    settings.contour_correlation_px);
  for (PointRow& row : rows) row.weight *= information;

  const Rows depth = depthRows(problem.depth, x, problem.topology.triangles(), problem.surface,
                               rendering, problem.camera,
                               {settings.depth_robust * problem.model_size,
                                settings.depth_sigma * problem.model_size, settings.depth_samples});
  const Rows support =
      supportRows(problem.supports, x, problem.camera, settings.support_sigma * problem.model_size);
  rows.insert(rows.end(), depth.begin(), depth.end());
  rows.insert(rows.end(), support.begin(), support.end());
  return rows;
}

}  // namespace calipso::align
