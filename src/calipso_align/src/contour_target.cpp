#include "calipso_align/contour_target.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace calipso::align {
namespace {

constexpr int kLeastPoints = 8;
constexpr double kSmoothableNoisePx = 0.25;  // below, points are taken as they are

std::string nameOf(int loop) { return "contour loop " + std::to_string(loop); }

void check(const ContourLoop& loop, int index) {
  const size_t n = loop.points.size();
  if (n < kLeastPoints) {
    throw std::invalid_argument(nameOf(index) + " has " + std::to_string(n) + " points, at least " +
                                std::to_string(kLeastPoints) + " are needed");
  }
  if (loop.known.size() != n || loop.confidence.size() != n) {
    throw std::invalid_argument(nameOf(index) + " has " + std::to_string(n) + " points but " +
                                std::to_string(loop.known.size()) + " known flags and " +
                                std::to_string(loop.confidence.size()) + " confidences");
  }
  for (size_t i = 0; i < n; ++i) {
    if (!loop.points[i].allFinite()) {
      throw std::invalid_argument(nameOf(index) + ": point " + std::to_string(i) +
                                  " is not a finite number");
    }
  }
}

double signedArea(const std::vector<Eigen::Vector2d>& p) {
  double twice = 0.0;
  for (size_t i = 0; i < p.size(); ++i) {
    const Eigen::Vector2d& a = p[i];
    const Eigen::Vector2d& b = p[(i + 1) % p.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}

// Standard deviation of white noise, from third differences (3 d^3 x = noise * sqrt(20) and a
// contour smooth at the scale of its points contributes next to nothing). Points far apart follow
// the shape instead of the noise, so that only dense contours are judged.
double whiteNoise(const std::vector<Eigen::Vector2d>& p) {
  const int n = static_cast<int>(p.size());
  std::vector<double> differences;
  differences.reserve(2 * n);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d d = p[i] - 3.0 * p[(i + 1) % n] + 3.0 * p[(i + 2) % n] - p[(i + 3) % n];
    differences.push_back(std::abs(d.x()));
    differences.push_back(std::abs(d.y()));
  }
  std::nth_element(differences.begin(), differences.begin() + n, differences.end());
  return 1.4826 * differences[n] / std::sqrt(20.0);
}

// Length of the loop without its noise: of the polygon through means of `block` points.
double lengthOf(const std::vector<Eigen::Vector2d>& p, int block) {
  const int n = static_cast<int>(p.size());
  const int blocks = std::max(4, n / std::max(1, block));
  std::vector<Eigen::Vector2d> means(blocks, Eigen::Vector2d::Zero());
  std::vector<int> counts(blocks, 0);
  for (int i = 0; i < n; ++i) {
    const int b = static_cast<int>(static_cast<long>(i) * blocks / n);
    means[b] += p[i];
    ++counts[b];
  }
  double length = 0.0;
  for (int b = 0; b < blocks; ++b) means[b] /= counts[b];
  for (int b = 0; b < blocks; ++b) length += (means[(b + 1) % blocks] - means[b]).norm();
  return length;
}

struct LocalFit {
  Eigen::Vector2d point, tangent;
};

// Moving least squares: a quadratic through the points within `half` of position s (in points),
// which bends with the contour where a running mean would shrink it.
LocalFit localQuadratic(const std::vector<Eigen::Vector2d>& p, double s, double half) {
  const int n = static_cast<int>(p.size());
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> b = Eigen::Matrix<double, 3, 2>::Zero();
  for (int i = static_cast<int>(std::ceil(s - half)); i <= std::floor(s + half); ++i) {
    const double t = (i - s) / half;
    const double tricube = std::pow(1.0 - std::pow(std::abs(t), 3), 3);
    const Eigen::Vector3d basis(1.0, t, t * t);
    A += tricube * basis * basis.transpose();
    b += tricube * basis * p[((i % n) + n) % n].transpose();
  }
  A.diagonal().array() += 1e-9 * A(0, 0);
  const Eigen::Matrix<double, 3, 2> c = A.ldlt().solve(b);
  return {c.row(0), c.row(1)};
}

// Half width of the smoothing window, px: wide enough that a third of a pixel of noise is left.
double windowPx(double noise_px, double points_per_px) {
  constexpr double kLeftPx = 0.3, kWidestPx = 22.0;
  const double half = std::pow(1.5 * noise_px / kLeftPx, 2) / (1.2 * points_per_px);
  return std::clamp(half, 2.0, kWidestPx);
}

double appendLoop(const ContourLoop& loop, int index, double spacing, double noise_px,
                  ContourTarget& target) {
  const int n = static_cast<int>(loop.points.size());
  const int block = noise_px > kSmoothableNoisePx ? std::max(1, n / 64) : 1;
  const double length = lengthOf(loop.points, block);
  if (!(length > 0.0)) throw std::invalid_argument(nameOf(index) + " has no extent");
  const double points_per_px = n / length;
  const double window_px = noise_px > kSmoothableNoisePx ? windowPx(noise_px, points_per_px) : 1.5;
  const double half = std::min(std::max(2.5, window_px * points_per_px), 0.25 * n);

  // The object lies to one side of the loop; for a hole it is the other one.
  const double side = (signedArea(loop.points) > 0.0) != loop.hole ? 1.0 : -1.0;
  const int count = std::max(kLeastPoints, static_cast<int>(std::lround(length / spacing)));
  for (int k = 0; k < count; ++k) {
    const double s = static_cast<double>(k) * n / count;
    const int source = static_cast<int>(s);
    const LocalFit fit = localQuadratic(loop.points, s, half);
    const Eigen::Vector2d tangent = fit.tangent.stableNormalized();
    const Eigen::Vector2d pixel = noise_px > kSmoothableNoisePx ? fit.point : loop.points[source];
    target.points.push_back({pixel, side * Eigen::Vector2d(tangent.y(), -tangent.x()),
                             length / count * loop.confidence[source], loop.known[source], index,
                             source});
    if (loop.known[source]) target.known_length_px += length / count;
  }
  return length;
}

}  // namespace

ContourTarget makeContourTarget(const std::vector<ContourLoop>& loops, double spacing_px) {
  if (!(spacing_px > 0.0)) {
    throw std::invalid_argument("contour spacing is " + std::to_string(spacing_px) +
                                " px, it must be positive");
  }
  if (loops.empty()) {
    throw std::invalid_argument("the contour is empty: segment the object first");
  }
  ContourTarget target;
  double noise_points = 0.0, points = 0.0;
  for (size_t l = 0; l < loops.size(); ++l) {
    check(loops[l], static_cast<int>(l));
    noise_points += whiteNoise(loops[l].points) * loops[l].points.size();
    points += loops[l].points.size();
  }
  target.noise_px = noise_points / points;
  for (size_t l = 0; l < loops.size(); ++l) {
    target.length_px +=
        appendLoop(loops[l], static_cast<int>(l), spacing_px, target.noise_px, target);
  }
  return target;
}

cv::Mat1b fillContour(const std::vector<ContourLoop>& loops, const cv::Size& size) {
  constexpr int kShift = 4;  // fractional bits of cv::fillPoly
  std::vector<std::vector<cv::Point>> polygons;
  for (const ContourLoop& loop : loops) {
    std::vector<cv::Point> polygon;
    for (const Eigen::Vector2d& p : loop.points) {
      polygon.emplace_back(static_cast<int>(std::lround(p.x() * (1 << kShift))),
                           static_cast<int>(std::lround(p.y() * (1 << kShift))));
    }
    polygons.push_back(std::move(polygon));
  }
  cv::Mat1b mask = cv::Mat1b::zeros(size);
  cv::fillPoly(mask, polygons, cv::Scalar(255), cv::LINE_8, kShift);  // even-odd: holes stay empty
  return mask;
}

cv::Mat1b fillTarget(const ContourTarget& target, const std::vector<ContourLoop>& loops,
                     const cv::Size& size) {
  if (target.noise_px <= kSmoothableNoisePx) return fillContour(loops, size);
  std::vector<ContourLoop> smooth(loops.size());
  for (const TargetPoint& p : target.points) smooth[p.loop].points.push_back(p.pixel);
  return fillContour(smooth, size);
}

}  // namespace calipso::align
