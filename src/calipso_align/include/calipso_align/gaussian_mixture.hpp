#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::align {

// Which cluster is split next when a mixture is started.
enum class Split {
  kWidest,   // of the largest variance: colours
  kThickest  // that is farthest from a plane: points of surfaces
};

// A mixture of Gaussians over triples, as in GrabCut (Rother et al. 2004): what an object, or the
// background, looks like, or where its surfaces lie. Deterministic: the start is a principal-axis
// split (Orchard and Bouman 1991), not a random draw. Immutable once fitted, so any number of
// threads may ask it for costs.
class GaussianMixture {
 public:
  // Fits `components` Gaussians to samples whose noise has a standard deviation of about 2 in every
  // channel (colours in 0..255); fewer where the samples do not support as many.
  // @throw std::invalid_argument when there is no sample
  static GaussianMixture fit(const std::vector<cv::Vec3f>& samples, int components,
                             Split split = Split::kWidest);

  // Negative log density of a sample under its best component; unit: nats.
  float cost(const cv::Vec3f& sample) const;

 private:
  // |L (x - mean)|^2 is the squared Mahalanobis distance; L = inverse Cholesky factor, row by row.
  struct Component {
    float mean[3];
    float l00, l10, l11, l20, l21, l22;
    float offset;  // -log(weight) + log(det covariance) / 2
  };
  static float squaredDistance(const Component& c, const cv::Vec3f& x);
  std::vector<Component> components_;
};

}  // namespace calipso::align
