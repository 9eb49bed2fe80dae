#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"

namespace calipso::align {

// Standard deviation per channel between two pictures (CV_8UC3), robustly, under a mask (CV_8U).
double noiseOf(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask);

// A picture in the light of another: scaled per channel by what the other is brighter or darker
// close by, over the pixels of a mask (CV_8U) that show the same in both.
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

// The background in a shadow that was not there before: its colour, darker by any factor.
struct Shadow {
  cv::Mat colour;  // CV_8UC3; empty: no shadow is expected
  cv::Mat share;   // CV_8U 0..255: how likely a pixel of the background lies in it, before looking
  double noise = 2.0;  // grey levels

  float cost(const cv::Vec3f& seen, int x, int y) const;
};

// A colour that is another one in a shadow, within the noise (grey levels).
bool isShadowed(const cv::Vec3f& lit, const cv::Vec3f& seen, double noise);

// Negative log density of a colour that is another one in some shadow, nats.
float shadowCost(const cv::Vec3f& lit, const cv::Vec3f& seen, double noise);

// The shadow on a background, expected as far as the pixels of `clear` (CV_8U: no object there)
// show it close by, and do not rather look like the object that may have moved there.
Shadow shadowOn(const cv::Mat& background, const cv::Mat& view, const cv::Mat& clear, double noise,
                const std::vector<const GaussianMixture*>& object);

// All accounts of a layer of the picture. A pixel that none of them explains may look like anything
// the layer has shown.
struct LayerAppearance {
  std::vector<Expectation> accounts;
  std::vector<const GaussianMixture*> colours;
  Shadow shadow = {};

  // Negative log density, nats.
  float cost(const cv::Vec3f& seen, int x, int y, float outlier_cost) const;
};

}  // namespace calipso::align
