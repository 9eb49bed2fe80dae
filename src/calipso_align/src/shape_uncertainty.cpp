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

double weightBeyond(const std::vector<SurfaceDistance>& draws, const std::vector<double>& weights,
                    const SurfaceDistance& limit) {
  double weight = 0.0;
  for (size_t k = 0; k < draws.size(); ++k) {
    if (draws[k].mean > limit.mean || draws[k].rms > limit.rms) weight += weights[k];
  }
  return weight;
}

// Point k is of draw k modulo their number.
std::vector<SurfaceDistance> perDraw(const std::vector<double>& distances, int count,
                                     double model_size) {
  std::vector<SurfaceDistance> draws(count);
  for (size_t k = 0; k < distances.size(); ++k) {
    const double part = distances[k] / model_size;
    draws[k % count].mean += part / kPointsPerDraw;
    draws[k % count].rms += part * part / kPointsPerDraw;
  }
  for (SurfaceDistance& draw : draws) draw.rms = std::sqrt(draw.rms);
  return draws;
}

// Every draw's points moved along their sight lines, all in proportion, back to where they came
// from as well as can be.
Points withoutDistance(const Points& moved, const Points& from, int count) {
  Eigen::ArrayXd along = Eigen::ArrayXd::Zero(count), squared = along;
  for (int k = 0; k < moved.rows(); ++k) {
    along[k % count] += moved.row(k).dot(from.row(k));
    squared[k % count] += moved.row(k).squaredNorm();
  }
  Points result = moved;
  for (int k = 0; k < moved.rows(); ++k) result.row(k) *= along[k % count] / squared[k % count];
  return result;
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
  return weightBeyond(draws, weights, limit);
}

double ShapeUncertainty::shapeBeyond(const SurfaceDistance& limit) const {
  return weightBeyond(without_distance, weights, limit);
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
    return {{{anywhere, anywhere}}, {{anywhere, anywhere}}, {1.0}};
  }
  // Consecutive points are of different draws: each draw is seen all over the surface.
  const int count = static_cast<int>(draws.maps.size());
  Points from(count * kPointsPerDraw, 3), moved(from.rows(), 3);
  for (int k = 0; k < moved.rows(); ++k) {
    const int f = faces[k * static_cast<long>(faces.size()) / moved.rows()];
    const Eigen::Vector3d centre = centreOf(x, triangles, f);
    const double along = unseen * model_size * normal(generator);
    from.row(k) = centre.transpose();
    moved.row(k) = (draws.maps[k % count](centre) + along * centre.normalized()).transpose();
  }
  const auto errorsOf = [&](const Points& points) {
    return perDraw(distancesToSurface(points, x, triangles), count, model_size);
  };
  return {errorsOf(moved), errorsOf(withoutDistance(moved, from, count)), draws.weights};
}

}  // namespace calipso::align
