#include "calipso_align/trust.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "unshown_holes.hpp"

namespace calipso::align {
namespace {

constexpr double kLeastKnown = 0.3;    // part of the contour
constexpr double kMostlyKnown = 0.95;  // less is worth a word
constexpr double kLeastMet = 0.8;      // part of the known contour: it may have spurs and details
constexpr double kMostOff = 0.02;      // part of the area: thin parts may be missing on either side
constexpr double kLargestMeanPx = 1.0;  // on top of half the contour's noise
constexpr double kLargestScale = 2.5;
// part of the distance: what is more uncertain is worth a word
constexpr double kDistanceKnown = 0.01;
// probability that the surface is further away than it should be
constexpr double kLargestOff = 0.1;

std::string percent(double part) { return std::to_string(std::lround(100.0 * part)) + " %"; }

double loopArea(const ContourLoop& loop) {
  double twice = 0.0;
  for (size_t i = 0; i < loop.points.size(); ++i) {
    const Eigen::Vector2d& a = loop.points[i];
    const Eigen::Vector2d& b = loop.points[(i + 1) % loop.points.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return std::abs(0.5 * twice);
}

// Two large pieces whose outlines are all known: nothing hides what should join them.
bool isInPieces(const std::vector<ContourLoop>& contour) {
  constexpr double kLargePiece = 0.1, kAllKnown = 0.98;
  std::vector<double> areas;
  double largest = 0.0;
  for (const ContourLoop& loop : contour) {
    if (loop.hole) continue;
    const double known = std::count(loop.known.begin(), loop.known.end(), true);
    largest = std::max(largest, loopArea(loop));
    if (known >= kAllKnown * loop.points.size()) areas.push_back(loopArea(loop));
  }
  return std::count_if(areas.begin(), areas.end(),
                       [&](double area) { return area >= kLargePiece * largest; }) > 1;
}

// Index of the target point nearest to a pixel.
size_t nearestTarget(const ContourTarget& target, const Eigen::Vector2d& pixel) {
  size_t best = 0;
  for (size_t k = 1; k < target.points.size(); ++k) {
    if ((target.points[k].pixel - pixel).squaredNorm() <
        (target.points[best].pixel - pixel).squaredNorm()) {
      best = k;
    }
  }
  return best;
}

// Area of the model outside of the contour by more than the tolerance, as part of the contour's
// area. Beyond unknown parts of the contour it may well be there.
double protrudingPart(const FitProblem& problem, const DepthRendering& rendering,
                      double tolerance_px) {
  constexpr int kStridePx = 2;
  const cv::Mat1b& inside = problem.inside;
  cv::Mat1f distance;
  cv::distanceTransform(inside == 0, distance, cv::DIST_L2, cv::DIST_MASK_3);
  double outside = 0.0;
  const cv::Rect& roi = rendering.roi;
  for (int v = roi.y; v < roi.y + roi.height; v += kStridePx) {
    for (int u = roi.x; u < roi.x + roi.width; u += kStridePx) {
      if (rendering.at(u, v) <= 0.0f || distance(v, u) <= tolerance_px) continue;
      const size_t nearest = nearestTarget(problem.target, {u, v});
      if (problem.target.points[nearest].known) outside += kStridePx * kStridePx;
    }
  }
  return outside / std::max(1, cv::countNonZero(inside));
}

// Area of the contour that the model leaves open by more than the tolerance, as part of its area.
// Details that it has not are no part of it. Nor are holes: of a lattice the contour often has
// none.
double openPart(const FitProblem& problem, const cv::Mat1b& silhouette, double tolerance_px) {
  cv::Mat1b inside = problem.inside;
  if (!problem.foreign.empty()) inside = inside & ~problem.foreign;
  cv::Mat1f distance;
  cv::distanceTransform(withoutHoles(silhouette) == 0, distance, cv::DIST_L2, cv::DIST_MASK_3);
  return static_cast<double>(cv::countNonZero(inside & (distance > tolerance_px))) /
         std::max(1, cv::countNonZero(inside));
}

// What the user should know of a fit that can be trusted.
std::string remarks(const FitProblem& problem, double known, double distance_sigma) {
  std::vector<std::string> all;
  if (spinAxis(problem.X, problem.topology.triangles())) {
    all.push_back(
        "spin about its axis undetermined: the shape is axisymmetric, so that the contour "
        "leaves it as it was placed");
  }
  if (known < kMostlyKnown) {
    all.push_back(
        "part of the contour is unknown: " + percent(1.0 - known) +
        " of it is hidden or cut by the image border, and the model there is as it was drawn");
  }
  if (distance_sigma > kDistanceKnown) {
    std::ostringstream distance;
    distance.precision(2);
    distance << "distance uncertain by " << 100.0 * distance_sigma
             << " % (standard deviation): a contour does not show it, it is about as placed";
    all.push_back(distance.str());
  }
  std::string text;
  for (const std::string& remark : all) text += (text.empty() ? "" : "; ") + remark;
  return text;
}

// Why a surface that meets its contour is not trusted along the sight line: its distance alone, or
// its shape, too.
std::string depthUndetermined(const ShapeUncertainty& error, double distance_sigma) {
  const double shape = error.shapeBeyond(kTrustedWithin);
  std::ostringstream text;
  text.precision(3);
  text << "depth undetermined: the contour is met, but the surface is off by more than "
       << 100.0 * kTrustedWithin.mean << " % of the size with a probability of "
       << percent(error.beyond(kTrustedWithin)) << ", "
       << (shape > kLargestOff ? "by turn and thickness along the sight line ("
                               : "by its distance and the size that goes with it, not its shape (")
       << percent(shape) << " with the distance left out); its distance is uncertain by "
       << 100.0 * distance_sigma
       << " % (standard deviation); give a depth image or the plane that the object stands on";
  return text.str();
}

// The model's silhouette without what is covered by something else: holes of the picture that are
// known to be an occluder's are none that the model lacks.
cv::Mat1b surelySeen(const FitProblem& problem, const cv::Mat1b& silhouette) {
  cv::Mat1b seen = silhouette.clone();
  if (problem.target.known_length_px >= problem.target.length_px) return seen;
  std::vector<cv::Point> covered;
  cv::findNonZero(withoutHoles(problem.inside) & ~problem.inside & silhouette, covered);
  for (const cv::Point& p : covered) {
    const size_t nearest = nearestTarget(problem.target, {p.x, p.y});
    if (!problem.target.points[nearest].known) seen(p) = 0;
  }
  return seen;
}

}  // namespace

FitQuality assess(const FitProblem& problem, const Points& x) {
  constexpr double kFineStepPx = 0.5, kMetPx = 2.0;
  const DepthRendering rendering = renderDepth(x, problem.topology, problem.camera);
  FitQuality quality;
  const std::vector<OutlinePoint> outline =
      occludingContour(x, problem.topology, rendering, problem.camera, kFineStepPx);
  quality.residuals = contourResiduals(problem.target, outline);
  quality.tolerance_px = kMetPx + problem.target.noise_px;
  std::vector<double> sizes;
  int known = 0;
  for (size_t k = 0; k < quality.residuals.size(); ++k) {
    known += problem.target.points[k].known;
    if (std::isfinite(quality.residuals[k])) sizes.push_back(std::abs(quality.residuals[k]));
  }
  if (sizes.empty()) return quality;
  int met = 0;
  for (const double size : sizes) {
    if (size > quality.tolerance_px) continue;
    quality.met_mean_px += size;
    ++met;
  }
  quality.met_mean_px /= std::max(1, met);
  quality.met = static_cast<double>(met) / known;
  const cv::Mat1b silhouette = maskOf(rendering, problem.camera);
  quality.open = openPart(problem, silhouette, quality.tolerance_px);
  // A bar of a lattice may be off on either side of a hole; of the contour's noise the mask has
  // next to none.
  constexpr double kHolePx = 2.0 * kMetPx;
  quality.model_holes_px = unshownHoles(silhouette, problem.inside, kHolePx);
  quality.picture_holes_px = unshownHoles(problem.inside, surelySeen(problem, silhouette), kHolePx);
  quality.protruding = protrudingPart(problem, rendering, quality.tolerance_px);
  quality.mean_px = std::accumulate(sizes.begin(), sizes.end(), 0.0) / sizes.size();
  const auto p95 = sizes.begin() + static_cast<long>(0.95 * (sizes.size() - 1));
  std::nth_element(sizes.begin(), p95, sizes.end());
  quality.p95_px = *p95;
  return quality;
}

double misfit(const FitQuality& quality) {
  constexpr double kUnmet = 0.05;
  return quality.open + quality.protruding + kUnmet * (1.0 - quality.met);
}

Verdict judge(const FitProblem& problem, const std::vector<ContourLoop>& contour,
              const FitQuality& quality, double scale, double distance_sigma,
              const ShapeUncertainty& error) {
  std::ostringstream reason;
  reason.precision(3);
  const double known = problem.target.known_length_px / problem.target.length_px;
  const double allowed = kLargestMeanPx + 0.5 * problem.target.noise_px;
  if (known < kLeastKnown) {
    reason << "contour mostly unknown: only " << percent(known)
           << " of it is not hidden or cut by the image border";
  } else if (quality.met < kLeastMet || quality.protruding > kMostOff || quality.open > kMostOff ||
             quality.met_mean_px > allowed) {
    reason << "did not converge: the contour is off by " << quality.mean_px << " px on average, "
           << percent(quality.met) << " of it is met within " << quality.tolerance_px << " px, "
           << percent(quality.protruding) << " of its area the model has besides, "
           << percent(quality.open) << " it leaves open; place the model closer";
    if (isInPieces(contour)) reason << ", or correct the contour: it is in separate pieces";
  } else if (scale > kLargestScale || scale < 1.0 / kLargestScale) {
    reason << "size implausible: the model had to be scaled by " << scale
           << "; check its unit and its distance";
  } else if (quality.model_holes_px > 0.0) {
    reason << "the model shows a hole of " << quality.model_holes_px
           << " px^2 that the picture does not: correct the contour if it was overlooked; one that "
              "the "
              "object has closed stays open";
  } else if (quality.picture_holes_px > 0.0) {
    reason << "the picture shows a hole of " << quality.picture_holes_px
           << " px^2 that the model does not: correct the contour if something hides the object "
              "there, "
              "or place the model closer";
  } else if (error.beyond(kTrustedWithin) > kLargestOff) {
    reason << depthUndetermined(error, distance_sigma);
  } else {
    return {true, remarks(problem, known, distance_sigma)};
  }
  return {false, reason.str()};
}

}  // namespace calipso::align
