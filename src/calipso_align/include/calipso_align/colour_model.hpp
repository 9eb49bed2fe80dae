#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::align {

// A mixture of Gaussians over colour, as in GrabCut (Rother et al. 2004): what an object, or the
// background, looks like. Deterministic: the start is a principal-axis split (Orchard and Bouman
// 1991), not a random draw. Immutable once fitted, so any number of threads may ask it for costs.
class ColourModel {
 public:
  // Fits `components` Gaussians to colours in 0..255; fewer where the colours do not support as many.
  // @throw std::invalid_argument when there is no sample
  static ColourModel fit(const std::vector<cv::Vec3f>& samples, int components);

  // Negative log density of a colour under its best component; unit: nats.
  float cost(const cv::Vec3f& colour) const;

  int componentCount() const { return static_cast<int>(components_.size()); }

 private:
  struct Component {
    Eigen::Vector3f mean;
    Eigen::Matrix3f whitening;  // |whitening (x - mean)|^2 is the squared Mahalanobis distance
    float offset = 0.0f;        // -log(weight) + log(det covariance) / 2
  };
  std::vector<Component> components_;
};

}  // namespace calipso::align
