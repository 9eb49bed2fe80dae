#include "calipso_align/rough_fit.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "calipso_align/depth_term.hpp"
#include "calipso_align/schedule.hpp"

namespace calipso::align {
namespace {

// Whether enough of the contour is known to compare it with the whole model.
bool isComparable(const FitProblem& problem) {
  constexpr double kLeastKnown = 0.9;  // part of its length
  return problem.target.known_length_px >= kLeastKnown * problem.target.length_px;
}

double focalLength(const Camera& camera) { return std::sqrt(camera.fx * camera.fy); }

// Size of the model that shows in the picture, m: of what is seen along its length that is little.
// What reaches behind the camera may look as large as it is.
double sizeInView(const FitProblem& problem) {
  if (problem.X.col(2).minCoeff() <= 0.0) return problem.model_size;
  Eigen::AlignedBox2d seen;
  for (Eigen::Index i = 0; i < problem.X.rows(); ++i)
    seen.extend(problem.camera.project(problem.X.row(i).transpose()));
  const double z = problem.X.col(2).mean();
  return std::min(problem.model_size, seen.diagonal().norm() * z / focalLength(problem.camera));
}

// The contour's size against that which the model has in the picture.
double apparentScale(const FitProblem& problem) {
  const double z = problem.X.col(2).mean();
  return problem.extent_px * z / (focalLength(problem.camera) * sizeInView(problem));
}

// By what the model's coordinates would have to be multiplied to fill the contour: it then shrinks
// towards its frame's origin, which stays where it was placed.
//   s size f / (z0 + s (z - z0)) = extent
double unitScale(const FitProblem& problem) {
  const double z0 = problem.origin.z(), arm = problem.X.col(2).mean() - z0;
  const double full = focalLength(problem.camera) * sizeInView(problem);
  const double scale = problem.extent_px * z0 / (full - problem.extent_px * arm);
  return scale > 0.0 && std::isfinite(scale) ? scale : apparentScale(problem);
}

struct Moments {
  double area = 0.0;
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();
};

Moments momentsOf(const cv::Mat1b& mask) {
  const cv::Moments m = cv::moments(mask, true);
  if (m.m00 <= 0.0) return {};
  return {m.m00, {m.m10 / m.m00, m.m01 / m.m00}};
}

LowOrderMap::Parameters shiftOf(const Eigen::Vector2d& px, double z, const Camera& camera) {
  LowOrderMap::Parameters step = LowOrderMap::Parameters::Zero();
  step[LowOrderMap::kTranslation] = px.x() * z / camera.fx;
  step[LowOrderMap::kTranslation + 1] = px.y() * z / camera.fy;
  return step;
}

// Shift and scale by which the rendered silhouette's moments become the contour's.
void matchMoments(const FitProblem& problem, const Moments& goal, LowOrderMap& map) {
  constexpr double kLargestLogScale = 0.25;  // per round
  const Camera& camera = problem.camera;
  const Points x = map.apply(problem.X);
  const Moments now = momentsOf(maskOf(renderDepth(x, problem.topology, camera), camera));
  if (now.area <= 0.0) return;
  LowOrderMap::Parameters step = shiftOf(goal.centroid - now.centroid, x.col(2).mean(), camera);
  step[LowOrderMap::kLogScale] =
      std::clamp(0.5 * std::log(goal.area / now.area), -kLargestLogScale, kLargestLogScale);
  map.setParameters(map.plus(step));
}

// Shift by which the silhouette covers most of the contour's inside, and least of what the picture
// shows behind the object; where something hides it, it may be or not.
void matchKnown(const FitProblem& problem, LowOrderMap& map) {
  constexpr double kInside = 2.0, kNearby = 0.05;  // of the area, for the farthest shift
  const Camera& camera = problem.camera;
  const Points x = map.apply(problem.X);
  const DepthRendering rendering = renderDepth(x, problem.topology, camera);
  if (rendering.roi.empty()) return;
  const int reach = cvCeil(kPlacementError * std::max(camera.fx, camera.fy));
  cv::Mat1f worth(problem.inside.size(), -1.0f);
  worth.setTo(0.0f, problem.hiding);
  worth.setTo(kInside, problem.inside);
  cv::copyMakeBorder(worth, worth, reach, reach, reach, reach, cv::BORDER_CONSTANT, 0.0);
  cv::Mat1f silhouette, gain;
  cv::Mat(rendering.depth > 0.0f).convertTo(silhouette, CV_32F, 1.0 / 255.0);
  const cv::Rect around(rendering.roi.tl(), rendering.roi.size() + cv::Size(2 * reach, 2 * reach));
  cv::matchTemplate(worth(around), silhouette, gain, cv::TM_CCORR);
  const double farness = kNearby * cv::countNonZero(problem.inside) / (reach * reach);
  for (int v = 0; v < gain.rows; ++v)
    for (int u = 0; u < gain.cols; ++u)
      gain(v, u) -=
          static_cast<float>(farness * ((u - reach) * (u - reach) + (v - reach) * (v - reach)));
  cv::Point best;
  cv::minMaxLoc(gain, nullptr, nullptr, nullptr, &best);
  const Eigen::Vector2d shift(best.x - reach, best.y - reach);
  map.setParameters(map.plus(shiftOf(shift, x.col(2).mean(), camera)));
}

// Shift along the sight line of the centroid to where the depth image has the object.
void matchDepth(const FitProblem& problem, LowOrderMap& map) {
  if (problem.depth.empty()) return;
  const Points x = map.apply(problem.X);
  const Eigen::Vector3d centroid = x.colwise().mean().transpose();
  const double offset =
      medianDepthOffset(problem.depth, renderDepth(x, problem.topology, problem.camera));
  LowOrderMap::Parameters step = LowOrderMap::Parameters::Zero();
  step.segment<3>(LowOrderMap::kTranslation) = centroid / centroid.z() * offset;
  map.setParameters(map.plus(step));
}

}  // namespace

RoughCheck checkPlacement(const FitProblem& problem) {
  // A model far larger or smaller than the contour was drawn in another unit; of one that is mostly
  // hidden or cut, the contour may be that much smaller, too.
  constexpr double kImplausible = 5.0, kMostHidden = 10.0;
  const double z = problem.X.col(2).mean();
  if (z <= 0.0) {
    std::ostringstream text;
    text.precision(3);
    text << "the rough placement is behind the camera (" << -z << " m): move the model ("
         << problem.model_size << " m) in front of it, or scale it if it is in millimetres";
    return {false, text.str()};
  }
  const double scale = apparentScale(problem);
  const double smallest = 1.0 / (isComparable(problem) ? kImplausible : kImplausible * kMostHidden);
  if (scale > kImplausible || scale < smallest) {
    std::ostringstream text;
    text.precision(3);
    text << "size implausible: the model (" << problem.model_size << " m) at its rough distance ("
         << z << " m) would have to be scaled by " << unitScale(problem)
         << " to fill the contour; is it in millimetres? Scale it by about that much";
    return {false, text.str()};
  }
  if (renderDepth(problem.X, problem.topology, problem.camera).roi.empty()) {
    return {false, "the rough placement is off the image: move the model onto the object"};
  }
  return {};
}

void placeRoughly(const FitProblem& problem, LowOrderMap& map) {
  constexpr int kRounds = 3;
  const bool comparable = isComparable(problem);
  const Moments goal = comparable ? momentsOf(problem.inside) : Moments{};
  for (int round = 0; round < kRounds; ++round) {
    matchDepth(problem, map);
    if (goal.area > 0.0)
      matchMoments(problem, goal, map);
    else if (!comparable && !problem.hiding.empty())
      matchKnown(problem, map);
  }
}

}  // namespace calipso::align
