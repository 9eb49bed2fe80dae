#include "calipso_align/trust.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <sstream>

namespace calipso::align {
namespace {

constexpr double kLeastKnown = 0.3;      // part of the contour
constexpr double kLeastMet = 0.8;        // part of the known contour: it may have spurs and details
constexpr double kMostProtruding = 0.25; // part of the outline: the contour may lack thin parts
constexpr double kLargestMeanPx = 1.0;   // on top of half the contour's noise
constexpr double kLargestScale = 2.5;

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
  constexpr double kLargePiece = 0.1, kMostlyKnown = 0.98;
  std::vector<double> areas;
  double largest = 0.0;
  for (const ContourLoop& loop : contour) {
    if (loop.hole) continue;
    const double known = std::count(loop.known.begin(), loop.known.end(), true);
    largest = std::max(largest, loopArea(loop));
    if (known >= kMostlyKnown * loop.points.size()) areas.push_back(loopArea(loop));
  }
  return std::count_if(areas.begin(), areas.end(),
                       [&](double area) { return area >= kLargePiece * largest; }) > 1;
}

}  // namespace

FitQuality assess(const FitProblem& problem, const Points& x) {
  constexpr double kFineStepPx = 0.5;
  const DepthRendering rendering = renderDepth(x, problem.topology.triangles(), problem.camera);
  FitQuality quality;
  const std::vector<OutlinePoint> outline =
      occludingContour(x, problem.topology, rendering, problem.camera, kFineStepPx);
  quality.residuals = contourResiduals(problem.target, outline);
  quality.tolerance_px = 2.0 + problem.target.noise_px;
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
  const std::vector<double> outwards = outlineResiduals(problem.target, outline);
  quality.protruding =
      static_cast<double>(std::count_if(outwards.begin(), outwards.end(), [&](double r) {
        return r > quality.tolerance_px;
      })) / std::max<size_t>(1, outwards.size());
  quality.mean_px = std::accumulate(sizes.begin(), sizes.end(), 0.0) / sizes.size();
  const auto p95 = sizes.begin() + static_cast<long>(0.95 * (sizes.size() - 1));
  std::nth_element(sizes.begin(), p95, sizes.end());
  quality.p95_px = *p95;
  return quality;
}

Verdict judge(const FitProblem& problem, const std::vector<ContourLoop>& contour,
              const FitQuality& quality, double scale) {
  std::ostringstream reason;
  reason.precision(3);
  const double known = problem.target.known_length_px / problem.target.length_px;
  const double allowed = kLargestMeanPx + 0.5 * problem.target.noise_px;
  if (known < kLeastKnown) {
    reason << "contour mostly unknown: only " << percent(known)
           << " of it is not hidden or cut by the image border";
  } else if (quality.met < kLeastMet || quality.protruding > kMostProtruding ||
             quality.met_mean_px > allowed) {
    reason << "did not converge: the contour is off by " << quality.mean_px << " px on average, "
           << percent(quality.met) << " of it is met within " << quality.tolerance_px << " px, "
           << percent(quality.protruding)
           << " of the model's outline lies outside of it; place the model closer";
    if (isInPieces(contour)) reason << ", or correct the contour: it is in separate pieces";
  } else if (scale > kLargestScale || scale < 1.0 / kLargestScale) {
    reason << "size implausible: the model had to be scaled by " << scale
           << "; check its unit and its distance";
  } else {
    if (spinAxis(problem.X)) {
      reason << "spin about its axis undetermined: the shape is axisymmetric, so that the contour "
                "leaves it as it was placed";
    }
    return {true, reason.str()};
  }
  return {false, reason.str()};
}

std::optional<Eigen::Vector3d> spinAxis(const Points& X) {
  constexpr double kSymmetric = 0.01;  // of the size: what the surface may differ after a turn
  const Points d = X.rowwise() - X.colwise().mean();
  const double size = std::sqrt(d.rowwise().squaredNorm().mean());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(d.transpose() * d);
  const int step = std::max<int>(1, static_cast<int>(d.rows()) / 300);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = axes.eigenvectors().col(k);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, axis).toRotationMatrix();
    // Vertices lie on circles about the axis: compare radius and height, not the vertices themselves.
    double worst = 0.0;
    for (int i = 0; i < d.rows(); i += step) {
      const Eigen::RowVector3d p = d.row(i) * turn.transpose();
      worst = std::max(worst, std::sqrt((d.rowwise() - p).rowwise().squaredNorm().minCoeff()));
      if (worst > 0.25 * size) break;
    }
    double spacing = 0.0;
    for (int i = 0; i < d.rows(); i += step) {
      Eigen::VectorXd distances = (d.rowwise() - d.row(i)).rowwise().squaredNorm();
      distances[i] = 1e300;
      spacing = std::max(spacing, std::sqrt(distances.minCoeff()));
    }
    if (worst < spacing + kSymmetric * size) return axis;
  }
  return std::nullopt;
}

}  // namespace calipso::align
