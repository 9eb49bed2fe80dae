#include "calipso_align/shape_uncertainty.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "calipso_align/surface_distance.hpp"

namespace calipso::align {
namespace {

constexpr int kDraws = 64;
constexpr int kPointsPerDraw = 20;  // place its mean to some 15 %

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

// Maps drawn from the fit's covariance, with what else is known as their weights.
struct Draws {
  std::vector<LowOrderMap> maps;
  std::vector<double> weights;  // sum to one
};

Draws drawMaps(const LowOrderMap& here, const Eigen::MatrixXd& covariance,
               const Likelihood& likelihood, std::mt19937& generator,
               std::normal_distribution<double>& normal) {
  constexpr int kMostTries = 50 * kDraws;
  const Eigen::MatrixXd L = squareRoot(covariance);
  Draws draws;
  double sum = 0.0;
  for (int t = 0; t < kMostTries && draws.maps.size() < kDraws; ++t) {
    LowOrderMap::Parameters z;
    for (int i = 0; i < z.size(); ++i) z[i] = normal(generator);
    const LowOrderMap::Parameters step = L * z;
    const double weight = likelihood(step);
    if (!(weight > 0.0)) continue;
    draws.weights.push_back(weight);
    sum += weight;
    draws.maps.push_back(here);
    draws.maps.back().setParameters(here.plus(step));
  }
  for (double& weight : draws.weights) weight /= sum;
  return draws;
}

Eigen::Vector3d centreOf(const Points& x, const Triangles& triangles, int f) {
  return (x.row(triangles(f, 0)) + x.row(triangles(f, 1)) + x.row(triangles(f, 2))).transpose() /
         3.0;
}

}  // namespace

SurfaceDistance ShapeUncertainty::expected() const {
  SurfaceDistance all;
  for (size_t k = 0; k < draws.size(); ++k) {
    all.mean += weights[k] * draws[k].mean;
    all.rms += weights[k] * draws[k].rms * draws[k].rms;
  }
  all.rms = std::sqrt(all.rms);
  return all;
}

double ShapeUncertainty::beyond(const SurfaceDistance& limit) const {
  double probability = 0.0;
  for (size_t k = 0; k < draws.size(); ++k) {
    if (draws[k].mean > limit.mean || draws[k].rms > limit.rms) probability += weights[k];
  }
  return probability;
}

ShapeUncertainty shapeUncertainty(const Points& x, const Triangles& triangles,
                                  const LowOrderMap& here, const Eigen::MatrixXd& covariance,
                                  double model_size, double unseen, const Likelihood& likelihood) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  const std::vector<int> faces = facesByArea(x, triangles, kDraws * kPointsPerDraw);
  if (faces.empty()) return {};
  const Draws draws = drawMaps(here, covariance, likelihood, generator, normal);
  if (draws.maps.empty()) {  // nothing agrees with what is known besides: it may be anywhere
    const double anywhere = std::numeric_limits<double>::infinity();
    return {{{anywhere, anywhere}}, {1.0}};
  }
  // Consecutive points are of different draws: each draw is seen all over the surface.
  const int count = static_cast<int>(draws.maps.size());
  Points moved(count * kPointsPerDraw, 3);
  for (int k = 0; k < moved.rows(); ++k) {
    const int f = faces[k * static_cast<long>(faces.size()) / moved.rows()];
    const Eigen::Vector3d centre = centreOf(x, triangles, f);
    const double along = unseen * model_size * normal(generator);
    moved.row(k) = (draws.maps[k % count](centre) + along * centre.normalized()).transpose();
  }
  ShapeUncertainty error{std::vector<SurfaceDistance>(count), draws.weights};
  const std::vector<double> distances = distancesToSurface(moved, x, triangles);
  for (size_t k = 0; k < distances.size(); ++k) {
    const double part = distances[k] / model_size;
    error.draws[k % count].mean += part / kPointsPerDraw;
    error.draws[k % count].rms += part * part / kPointsPerDraw;
  }
  for (SurfaceDistance& draw : error.draws) draw.rms = std::sqrt(draw.rms);
  return error;
}

}  // namespace calipso::align
