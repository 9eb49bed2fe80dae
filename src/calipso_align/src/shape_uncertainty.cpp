#include "calipso_align/shape_uncertainty.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

#include "calipso_align/metrics.hpp"

namespace calipso::align {
namespace {

constexpr int kDraws = 64;   // place the mean to a tenth

// Points for one draw: few enough for the time, since every one is compared with all faces.
int pointsPerDraw(const Triangles& triangles) {
  constexpr double kComparisons = 5e6;
  const double most = kComparisons / (kDraws * std::max<double>(1.0, triangles.rows()));
  return std::clamp(static_cast<int>(most), 4, 20);
}

// Some matrix L with L L' = C, C positive semi-definite but for rounding.
Eigen::MatrixXd squareRoot(const Eigen::MatrixXd& C) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(C);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

// Faces at equal steps of the area.
std::vector<int> facesByArea(const Points& x, const Triangles& triangles, int count) {
  std::vector<double> upTo;
  double area = 0.0;
  for (int f = 0; f < triangles.rows(); ++f) {
    const Eigen::Vector3d a = x.row(triangles(f, 0)), b = x.row(triangles(f, 1)),
                          c = x.row(triangles(f, 2));
    upTo.push_back(area += (b - a).cross(c - a).norm());
  }
  std::vector<int> faces;
  for (int k = 0; k < count && area > 0.0; ++k) {
    const auto at = std::lower_bound(upTo.begin(), upTo.end(), area * (k + 0.5) / count);
    faces.push_back(static_cast<int>(at - upTo.begin()));
  }
  return faces;
}

}  // namespace

ShapeUncertainty shapeUncertainty(const Points& x, const Triangles& triangles,
                                  const LowOrderMap& here, const Eigen::MatrixXd& covariance,
                                  double model_size, double unseen) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd L = squareRoot(covariance);
  const std::vector<int> faces = facesByArea(x, triangles, kDraws * pointsPerDraw(triangles));
  if (faces.empty()) return {};

  std::vector<LowOrderMap> draws(kDraws, here);
  for (LowOrderMap& draw : draws) {
    LowOrderMap::Parameters z;
    for (int i = 0; i < z.size(); ++i) z[i] = normal(generator);
    draw.setParameters(here.plus(L * z));
  }
  // Consecutive points are of different draws: each draw is seen all over the surface.
  Points moved(faces.size(), 3);
  for (int k = 0; k < moved.rows(); ++k) {
    const int f = faces[k];
    const Eigen::Vector3d centre =
        (x.row(triangles(f, 0)) + x.row(triangles(f, 1)) + x.row(triangles(f, 2))).transpose() / 3.0;
    const double along = unseen * model_size * normal(generator);
    moved.row(k) = (draws[k % kDraws](centre) + along * centre.normalized()).transpose();
  }
  ShapeUncertainty error;
  for (const double distance : distancesToSurface(moved, x, triangles)) {
    error.mean += distance / (model_size * moved.rows());
    error.rms += distance * distance / (model_size * model_size * moved.rows());
  }
  error.rms = std::sqrt(error.rms);
  return error;
}

}  // namespace calipso::align
