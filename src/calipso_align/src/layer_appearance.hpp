#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"

namespace calipso::align {

// Standard deviation per channel between two pictures (CV_8UC3), robustly, under a mask (CV_8U).
double noiseOf(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask);

// A picture in the light of another: scaled per channel by what the other is brighter or darker close
// by, over the pixels of a mask (CV_8U) that show the same in both.
cv::Mat relit(const cv::Mat& image, const cv::Mat& other, const cv::Mat& same);

// One account of what a pixel shows: the colour it should have, within the noise.
struct Expectation {
  cv::Mat colour;  // CV_8UC3
  cv::Mat share;   // CV_8U 0..255: how likely the account is at a pixel, before looking
  float factor;    // of `share`
  double noise;    // grey levels

  // Negative log density, nats; kForbidden where the account does not apply.
  float cost(const cv::Vec3f& seen, int x, int y) const;
};

// All accounts of a layer of the picture. A pixel that none of them explains may look like anything
// the layer has shown.
struct LayerAppearance {
  std::vector<Expectation> accounts;
  std::vector<const GaussianMixture*> colours;

  // Negative log density, nats.
  float cost(const cv::Vec3f& seen, int x, int y, float outlier_cost) const;
};

}  // namespace calipso::align
