#include "calipso_align/gaussian_mixture.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace calipso::align {
namespace {

constexpr int kRefinements = 4;
// Variance of sensor noise and quantisation: no component is narrower.
constexpr double kNoiseVariance = 4.0;
// A component needs this many samples for its covariance to mean anything.
constexpr int kMinSamples = 12;

struct Cluster {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int count = 0;
};

// Sums of one cluster's samples about a common origin, so that large coordinates lose no digits.
struct Sums {
  double n = 0, x = 0, y = 0, z = 0, xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  void add(const cv::Vec3f& p) {
    const double a = p[0], b = p[1], c = p[2];
    n += 1, x += a, y += b, z += c;
    xx += a * a, xy += a * b, xz += a * c, yy += b * b, yz += b * c, zz += c * c;
  }
  Cluster cluster() const {
    Cluster result;
    result.count = static_cast<int>(n);
    if (n == 0) return result;
    result.mean = Eigen::Vector3d(x, y, z) / n;
    result.covariance << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    result.covariance = result.covariance / n - result.mean * result.mean.transpose();
    result.covariance.diagonal().array() += kNoiseVariance;
    return result;
  }
};

std::vector<Cluster> describe(const std::vector<cv::Vec3f>& samples, const std::vector<int>& owner,
                              size_t count) {
  std::vector<Sums> sums(count);
  for (size_t i = 0; i < samples.size(); ++i) sums[owner[i]].add(samples[i]);
  std::vector<Cluster> clusters;
  for (const Sums& s : sums) clusters.push_back(s.cluster());
  return clusters;
}

// Splits one cluster after the other along its principal axis, until there are `count`.
std::vector<Cluster> splitByPrincipalAxis(const std::vector<cv::Vec3f>& samples, size_t count,
                                          Split split) {
  std::vector<int> owner(samples.size(), 0);
  std::vector<Cluster> clusters = describe(samples, owner, 1);
  while (clusters.size() < count) {
    int chosen = -1;
    double largest = split == Split::kWidest ? 4.0 * kNoiseVariance : 0.0;
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    for (size_t k = 0; k < clusters.size(); ++k) {
      if (clusters[k].count < 2 * kMinSamples) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(clusters[k].covariance);
      const double thickness = eigen.eigenvalues()[0];
      const double spread = split == Split::kWidest            ? eigen.eigenvalues()[2]
                            : thickness > 2.0 * kNoiseVariance ? thickness * clusters[k].count
                                                               : 0.0;
      if (spread <= largest) continue;
      chosen = static_cast<int>(k);
      largest = spread;
      axis = eigen.eigenvectors().col(2);
    }
    if (chosen < 0) break;
    const int fresh = static_cast<int>(clusters.size());
    const double threshold = axis.dot(clusters[chosen].mean);
    for (size_t i = 0; i < samples.size(); ++i) {
      const Eigen::Vector3d x(samples[i][0], samples[i][1], samples[i][2]);
      if (owner[i] == chosen && axis.dot(x) > threshold) owner[i] = fresh;
    }
    clusters = describe(samples, owner, clusters.size() + 1);
  }
  return clusters;
}

}  // namespace

float GaussianMixture::squaredDistance(const Component& c, const cv::Vec3f& x) {
  const float a = x[0] - c.mean[0], b = x[1] - c.mean[1], d = x[2] - c.mean[2];
  const float p = c.l00 * a, q = c.l10 * a + c.l11 * b, r = c.l20 * a + c.l21 * b + c.l22 * d;
  return p * p + q * q + r * r;
}

GaussianMixture GaussianMixture::fit(const std::vector<cv::Vec3f>& samples, int components,
                                     Split split) {
  if (samples.empty())
    throw std::invalid_argument("GaussianMixture: no sample to fit; give at least one pixel");
  GaussianMixture model;
  const auto adopt = [&](const std::vector<Cluster>& clusters) {
    model.components_.clear();
    for (const Cluster& c : clusters) {
      if (c.count < std::min<int>(kMinSamples, static_cast<int>(samples.size()))) continue;
      const Eigen::Matrix3d factor = c.covariance.llt().matrixL();
      const Eigen::Matrix3f l = factor.inverse().cast<float>();
      const double weight = static_cast<double>(c.count) / samples.size();
      const double offset = -std::log(weight) + std::log(factor.diagonal().prod());
      model.components_.push_back({{static_cast<float>(c.mean[0]), static_cast<float>(c.mean[1]),
                                    static_cast<float>(c.mean[2])},
                                   l(0, 0),
                                   l(1, 0),
                                   l(1, 1),
                                   l(2, 0),
                                   l(2, 1),
                                   l(2, 2),
                                   static_cast<float>(offset)});
    }
  };

  adopt(splitByPrincipalAxis(samples, static_cast<size_t>(components), split));
  std::vector<int> owner(samples.size());
  for (int round = 0; round < kRefinements; ++round) {
    for (size_t i = 0; i < samples.size(); ++i) {
      float best = std::numeric_limits<float>::max();
      for (size_t k = 0; k < model.components_.size(); ++k) {
        const Component& component = model.components_[k];
        const float c = component.offset + 0.5f * squaredDistance(component, samples[i]);
        if (c < best) best = c, owner[i] = static_cast<int>(k);
      }
    }
    adopt(describe(samples, owner, model.components_.size()));
  }
  return model;
}

float GaussianMixture::cost(const cv::Vec3f& sample) const {
  float best = std::numeric_limits<float>::max();
  for (const Component& c : components_)
    best = std::min(best, c.offset + 0.5f * squaredDistance(c, sample));
  return best;
}

}  // namespace calipso::align
