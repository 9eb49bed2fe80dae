#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "calipso_align/contour.hpp"

namespace calipso::align {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Points = std::vector<Vector2d>;

constexpr double kProfileStep = 0.5;  // px
constexpr double kFlank = 2.0;  // px; further out than this a sample is pure fore- or background

int wrap(int i, int n) { return ((i % n) + n) % n; }

// A quadratic p(t) through the points first .. last around i, by least squares in arc index.
struct LocalFit {
  Vector2d position, tangent;  // at i
  double residual = 0.0;       // mean squared distance, px^2
};

LocalFit fitAround(const Points& points, const std::vector<double>& weights, int i, int first,
                   int last, double sigma) {
  const int n = static_cast<int>(points.size());
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> b = Eigen::Matrix<double, 3, 2>::Zero();
  for (int k = first; k <= last; ++k) {
    const int j = wrap(i + k, n);
    const double w = weights[j] * std::exp(-0.5 * k * k / (sigma * sigma));
    const Vector3d basis(1.0, k, k * k);
    A += w * basis * basis.transpose();
    b += w * basis * points[j].transpose();
  }
  const Eigen::Matrix<double, 3, 2> c = A.ldlt().solve(b);
  LocalFit fit{c.row(0).transpose(), c.row(1).transpose().normalized(), 0.0};
  double sum = 0.0;
  for (int k = first; k <= last; ++k) {
    const int j = wrap(i + k, n);
    const double w = weights[j] * std::exp(-0.5 * k * k / (sigma * sigma));
    const Eigen::RowVector3d basis(1.0, k, k * k);
    fit.residual += w * (points[j].transpose() - basis * c).squaredNorm();
    sum += w;
  }
  fit.residual /= sum;
  return fit;
}

// Moving least squares that does not round corners off: of the windows before, around and behind
// the point, the one that fits best counts (as in essentially non-oscillatory schemes). The
// one-sided windows must be clearly better, for they are noisier.
LocalFit smoothAt(const Points& points, const std::vector<double>& weights, int i, int half) {
  constexpr double kOneSidedBias = 2.0, kFlatResidual = 0.02;  // px^2: quantisation of a crack
  const double sigma = 0.6 * half;
  const LocalFit centred = fitAround(points, weights, i, -half, half, sigma);
  const LocalFit before = fitAround(points, weights, i, -2 * half, 0, 2.0 * sigma);
  const LocalFit behind = fitAround(points, weights, i, 0, 2 * half, 2.0 * sigma);
  const LocalFit& side = before.residual < behind.residual ? before : behind;
  return kOneSidedBias * (side.residual + kFlatResidual) < centred.residual ? side : centred;
}

Points smoothed(const Points& points, const std::vector<double>& weights, double smoothing_px,
                Points* normals) {
  const int n = static_cast<int>(points.size());
  const int half = std::min(static_cast<int>(std::lround(smoothing_px)), (n - 1) / 4);
  Points result(n);
  if (normals) normals->resize(n);
  for (int i = 0; i < n; ++i) {
    const LocalFit fit = smoothAt(points, weights, i, half);
    result[i] = fit.position;
    if (normals) (*normals)[i] = Vector2d(fit.tangent.y(), -fit.tangent.x());
  }
  return result;
}

Vector3d colourAt(const cv::Mat& image, const Vector2d& p) {
  const double u = std::clamp(p.x(), 0.0, image.cols - 1.001);
  const double v = std::clamp(p.y(), 0.0, image.rows - 1.001);
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const double a = u - x, b = v - y;
  const auto at = [&](int dx, int dy) {
    const cv::Vec3b& c =
        image.at<cv::Vec3b>(std::min(y + dy, image.rows - 1), std::min(x + dx, image.cols - 1));
    return Vector3d(c[0], c[1], c[2]);
  };
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

int labelAt(const cv::Mat& labels, const Vector2d& p) {
  const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
  if (x < 0 || y < 0 || x >= labels.cols || y >= labels.rows) return -1;
  return labels.at<uchar>(y, x);
}

struct EdgeEstimate {
  double offset;      // px along the outward normal
  double confidence;  // 0..1
};

// Mean colours on both sides of the edge, from samples that the mask gives to the object and to
// none.
struct Sides {
  Vector3d fore = Vector3d::Zero(), back = Vector3d::Zero();
  int fore_count = 0, back_count = 0;
};

Sides sampleSides(const cv::Mat& image, const cv::Mat& labels, int label, double reach,
                  const Vector2d& p, const Vector2d& normal) {
  Sides sides;
  for (double s = kFlank; s <= reach; s += kProfileStep) {
    const Vector2d inner = p - s * normal, outer = p + s * normal;
    if (labelAt(labels, inner) == label) sides.fore += colourAt(image, inner), ++sides.fore_count;
    if (labelAt(labels, outer) == 0) sides.back += colourAt(image, outer), ++sides.back_count;
  }
  if (sides.fore_count > 0) sides.fore /= sides.fore_count;
  if (sides.back_count > 0) sides.back /= sides.back_count;
  return sides;
}

// Centroid of the steepest fall of a profile alpha(s), 1 inside and 0 outside: unlike the integral
// of alpha it does not follow the slow shading on either side. `share`: how much of the fall is
// there.
struct Fall {
  double position = 0.0, share = 0.0;
};

Fall steepestFall(const std::vector<double>& alpha, double first_s, double max_offset) {
  constexpr int kReach = 3;  // samples on both sides: 1.75 px, the width of a sharp edge's blur
  const int n = static_cast<int>(alpha.size()) - 1;
  Fall best;
  for (int k = kReach; k < n - kReach; ++k) {
    const double centre = first_s + (k + 0.5) * kProfileStep;
    if (std::abs(centre) > max_offset) continue;
    double share = 0.0, moment = 0.0;
    for (int j = k - kReach; j <= k + kReach; ++j) {
      const double fall = std::max(0.0, alpha[j] - alpha[j + 1]);
      share += fall;
      moment += fall * (first_s + (j + 0.5) * kProfileStep);
    }
    if (share > best.share) best = {moment / share, share};
  }
  return best;
}

// Where along the normal the colour changes from the object's to its surroundings', on
// alpha(s) = (I(s) - B).(F - B) / |F - B|^2.
std::optional<EdgeEstimate> locateEdge(const cv::Mat& image, const cv::Mat& labels, int label,
                                       const ContourParams& params, const Vector2d& p,
                                       const Vector2d& normal) {
  constexpr double kMinShare = 0.5, kMaxShare = 1.25;  // more falls at a rim of a third colour
  constexpr int kMinSideSamples = 2;
  const Sides sides = sampleSides(image, labels, label, params.window_px, p, normal);
  if (sides.fore_count < kMinSideSamples || sides.back_count < kMinSideSamples) return std::nullopt;
  const Vector3d difference = sides.fore - sides.back;
  const double contrast = difference.norm();
  if (contrast < params.min_contrast) return std::nullopt;

  const double reach = params.max_offset_px + 1.5;
  std::vector<double> alpha;
  for (double s = -reach; s <= reach; s += kProfileStep)
    alpha.push_back((colourAt(image, p + s * normal) - sides.back).dot(difference) /
                    (contrast * contrast));
  const Fall fall = steepestFall(alpha, -reach, params.max_offset_px);
  if (fall.share < kMinShare || fall.share > kMaxShare) return std::nullopt;
  const double clean = std::min(1.0, fall.share) * (2.0 - std::clamp(fall.share, 1.0, 2.0));
  return EdgeEstimate{fall.position, clean * contrast / (contrast + params.min_contrast)};
}

}  // namespace

void refineLoop(const cv::Mat& image, const cv::Mat& labels, int label, const ContourParams& params,
                ContourLoop& loop) {
  constexpr double kMaskWeight = 0.25;  // confidence of an edge that only the mask shows
  const int n = static_cast<int>(loop.points.size());
  std::vector<double> weights(n, 1.0);
  Points normals;
  const Points guide = smoothed(loop.points, weights, params.smoothing_px, &normals);
  for (int i = 0; i < n; ++i) {
    if (!loop.known[i]) continue;
    const auto edge = locateEdge(image, labels, label, params, guide[i], normals[i]);
    loop.points[i] = guide[i] + (edge ? edge->offset : 0.0) * normals[i];
    weights[i] = std::max(kMaskWeight, edge ? edge->confidence : 0.0);
    loop.confidence[i] = static_cast<float>(weights[i]);
  }
  const Points final_points = smoothed(loop.points, weights, params.smoothing_px, nullptr);
  for (int i = 0; i < n; ++i)
    if (loop.known[i]) loop.points[i] = final_points[i];
}

}  // namespace calipso::align
