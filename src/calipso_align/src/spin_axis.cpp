#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "calipso_align/trust.hpp"

namespace calipso::align {
namespace {

// Nearest points, sought from both sides along the axis in which the points spread most.
class NearestPoint {
 public:
  explicit NearestPoint(const Points& points) {
    (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff(&axis_);
    std::vector<int> order(points.rows());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&](int a, int b) { return points(a, axis_) < points(b, axis_); });
    sorted_.resize(points.rows(), 3);
    for (size_t i = 0; i < order.size(); ++i) sorted_.row(i) = points.row(order[i]);
  }

  // Distance of the nearest point, of the second nearest one if `other`.
  double distance(const Eigen::RowVector3d& p, bool other) const {
    const int n = static_cast<int>(sorted_.rows());
    int first = 0, count = n;  // lower bound of p along the axis
    while (count > 0) {
      const int half = count / 2;
      if (sorted_(first + half, axis_) < p[axis_]) {
        first += half + 1;
        count -= half + 1;
      } else {
        count = half;
      }
    }
    Best best;
    for (int i = first; i < n && square(sorted_(i, axis_) - p[axis_]) <= best.second; ++i) {
      best.add((sorted_.row(i) - p).squaredNorm());
    }
    for (int i = first - 1; i >= 0 && square(sorted_(i, axis_) - p[axis_]) <= best.second; --i) {
      best.add((sorted_.row(i) - p).squaredNorm());
    }
    return std::sqrt(other ? best.second : best.first);
  }

 private:
  struct Best {
    double first = std::numeric_limits<double>::max(), second = first;
    void add(double squared) {
      if (squared < first) std::swap(squared, first);
      second = std::min(second, squared);
    }
  };
  static double square(double x) { return x * x; }

  int axis_ = 0;
  Points sorted_;
};

}  // namespace

std::optional<Eigen::Vector3d> spinAxis(const Points& X) {
  constexpr double kSymmetric = 0.01;  // of the size: what the surface may differ after a turn
  const Points d = X.rowwise() - X.colwise().mean();
  const double size = std::sqrt(d.rowwise().squaredNorm().mean());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(d.transpose() * d);
  const int step = std::max<int>(1, static_cast<int>(d.rows()) / 300);
  const NearestPoint nearest(d);
  double spacing = 0.0;
  for (int i = 0; i < d.rows(); i += step) {
    spacing = std::max(spacing, nearest.distance(d.row(i), true));
  }
  const double allowed = spacing + kSymmetric * size;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = axes.eigenvectors().col(k);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, axis).toRotationMatrix();
    double worst = 0.0;
    for (int i = 0; i < d.rows() && worst < allowed; i += step) {
      worst = std::max(worst, nearest.distance(d.row(i) * turn.transpose(), false));
    }
    if (worst < allowed) return axis;
  }
  return std::nullopt;
}

}  // namespace calipso::align
