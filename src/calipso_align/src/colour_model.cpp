#include "calipso_align/colour_model.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace calipso::align {
namespace {

constexpr int kRefinements = 4;
// Variance of sensor noise and quantisation (grey levels squared): no component is narrower.
constexpr double kNoiseVariance = 4.0;
// A component needs this many samples for its covariance to mean anything.
constexpr int kMinSamples = 12;

struct Cluster {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  int count = 0;
};

Eigen::Vector3d toEigen(const cv::Vec3f& c) { return {c[0], c[1], c[2]}; }

Cluster describe(const std::vector<cv::Vec3f>& samples, const std::vector<int>& owner, int cluster) {
  Cluster c;
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < samples.size(); ++i) {
    if (owner[i] != cluster) continue;
    const Eigen::Vector3d x = toEigen(samples[i]);
    c.mean += x;
    second += x * x.transpose();
    ++c.count;
  }
  if (c.count == 0) return c;
  c.mean /= c.count;
  c.covariance = second / c.count - c.mean * c.mean.transpose();
  c.covariance.diagonal().array() += kNoiseVariance;
  return c;
}

// Splits the cluster with the largest variance along its principal axis, until there are `count`.
std::vector<Cluster> splitByPrincipalAxis(const std::vector<cv::Vec3f>& samples, int count) {
  std::vector<int> owner(samples.size(), 0);
  std::vector<Cluster> clusters = {describe(samples, owner, 0)};
  while (static_cast<int>(clusters.size()) < count) {
    int widest = -1;
    double spread = 4.0 * kNoiseVariance;
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    for (size_t k = 0; k < clusters.size(); ++k) {
      if (clusters[k].count < 2 * kMinSamples) continue;
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(clusters[k].covariance);
      if (eigen.eigenvalues()[2] <= spread) continue;
      widest = static_cast<int>(k);
      spread = eigen.eigenvalues()[2];
      axis = eigen.eigenvectors().col(2);
    }
    if (widest < 0) break;
    const int fresh = static_cast<int>(clusters.size());
    const double threshold = axis.dot(clusters[widest].mean);
    for (size_t i = 0; i < samples.size(); ++i)
      if (owner[i] == widest && axis.dot(toEigen(samples[i])) > threshold) owner[i] = fresh;
    clusters[widest] = describe(samples, owner, widest);
    clusters.push_back(describe(samples, owner, fresh));
  }
  return clusters;
}

}  // namespace

ColourModel ColourModel::fit(const std::vector<cv::Vec3f>& samples, int components) {
  if (samples.empty())
    throw std::invalid_argument("ColourModel: no sample to fit; give at least one pixel");
  ColourModel model;
  const auto adopt = [&](const std::vector<Cluster>& clusters) {
    model.components_.clear();
    for (const Cluster& c : clusters) {
      if (c.count < std::min<int>(kMinSamples, static_cast<int>(samples.size()))) continue;
      const Eigen::Matrix3d factor = c.covariance.llt().matrixL();
      const double weight = static_cast<double>(c.count) / samples.size();
      model.components_.push_back(
          {c.mean.cast<float>(), factor.inverse().cast<float>(),
           static_cast<float>(-std::log(weight) + std::log(factor.diagonal().prod()))});
    }
  };

  std::vector<Cluster> clusters = splitByPrincipalAxis(samples, components);
  adopt(clusters);
  std::vector<int> owner(samples.size());
  for (int round = 0; round < kRefinements; ++round) {
    for (size_t i = 0; i < samples.size(); ++i) {
      const Eigen::Vector3f x(samples[i][0], samples[i][1], samples[i][2]);
      float best = std::numeric_limits<float>::max();
      for (size_t k = 0; k < model.components_.size(); ++k) {
        const Component& c = model.components_[k];
        const float cost = c.offset + 0.5f * (c.whitening * (x - c.mean)).squaredNorm();
        if (cost < best) best = cost, owner[i] = static_cast<int>(k);
      }
    }
    for (size_t k = 0; k < model.components_.size(); ++k)
      clusters[k] = describe(samples, owner, static_cast<int>(k));
    clusters.resize(model.components_.size());
    adopt(clusters);
  }
  return model;
}

float ColourModel::cost(const cv::Vec3f& colour) const {
  const Eigen::Vector3f x(colour[0], colour[1], colour[2]);
  float best = std::numeric_limits<float>::max();
  for (const Component& c : components_)
    best = std::min(best, c.offset + 0.5f * (c.whitening * (x - c.mean)).squaredNorm());
  return best;
}

}  // namespace calipso::align
