#include "calipso_align/shape_uncertainty.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::align {

ShapeUncertainty shapeUncertainty(const Points& x, const Triangles& triangles,
                                  const LowOrderMap& here, const Eigen::MatrixXd& covariance,
                                  double model_size, double unseen) {
  constexpr int kSamples = 500;
  const double kMeanOfNormal = std::sqrt(2.0 / M_PI);   // E |N(0, 1)|
  const Points normals = faceNormals(x, triangles);
  const int step = std::max<int>(1, static_cast<int>(triangles.rows()) / kSamples);
  double area = 0.0, mean = 0.0, squared = 0.0;
  for (int f = 0; f < triangles.rows(); f += step) {
    const Eigen::Vector3d a = x.row(triangles(f, 0)), b = x.row(triangles(f, 1)),
                          c = x.row(triangles(f, 2)), n = normals.row(f);
    const double weight = (b - a).cross(c - a).norm();
    const Eigen::VectorXd g = here.jacobian((a + b + c) / 3.0).transpose() * n;
    const double along = unseen * model_size * n.dot(((a + b + c) / 3.0).normalized());
    const double variance =
        (std::max(0.0, g.dot(covariance * g)) + along * along) / (model_size * model_size);
    area += weight;
    mean += weight * kMeanOfNormal * std::sqrt(variance);
    squared += weight * variance;
  }
  if (!(area > 0.0)) return {};
  return {mean / area, std::sqrt(squared / area)};
}

}  // namespace calipso::align
