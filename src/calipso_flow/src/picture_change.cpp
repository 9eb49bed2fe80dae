#include "calipso_flow/picture_change.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {

double largestShift(const cv::Mat& before, const cv::Mat& now, const cv::Mat& where,
                    const cv::Point& origin) {
  const int left = std::max(0, 1 - origin.x);
  const int right = std::min(where.cols, before.cols - 1 - origin.x);
  const int bottom = std::min(where.rows, before.rows - 1 - origin.y);
  Eigen::Matrix2d energy = Eigen::Matrix2d::Zero();
  double change = 0.0;
  for (int y = std::max(0, 1 - origin.y); y < bottom; ++y) {
    const uchar* counts = where.ptr<uchar>(y);
    const float* above = before.ptr<float>(y + origin.y - 1) + origin.x;
    const float* here = before.ptr<float>(y + origin.y) + origin.x;
    const float* below = before.ptr<float>(y + origin.y + 1) + origin.x;
    const float* after = now.ptr<float>(y + origin.y) + origin.x;
    for (int x = left; x < right; ++x) {
      if (counts[x] == 0) continue;
      const Eigen::Vector2d gradient(0.5 * (here[x + 1] - here[x - 1]),
                                     0.5 * (below[x] - above[x]));
      energy += gradient * gradient.transpose();
      const double difference = after[x] - here[x];
      change += difference * difference;
    }
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> directions;
  const double least = directions.computeDirect(energy, Eigen::EigenvaluesOnly).eigenvalues()[0];
  // What is left of a sum of squares by rounding is no gradient.
  if (!(least > 1e-9 * energy.trace())) return std::numeric_limits<double>::infinity();
  return std::sqrt(change / least);
}

}  // namespace calipso::flow
