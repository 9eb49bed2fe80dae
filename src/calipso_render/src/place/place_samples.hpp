#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// Values of one pixel of the place over time, code values.
using Samples = std::vector<cv::Vec3b>;

// What the frames of a clip show of the place, all as seen from the key frame's camera.
class PlaceSamples {
 public:
  // @param margin px by which masks are grown; the frames must outlive this
  PlaceSamples(const std::vector<ClipFrame>& frames, int margin);

  // Does frame i show the place itself?
  bool shows(std::size_t i, int u, int v) const { return covered_[i].at<std::uint8_t>(v, u) == 0; }
  // Of the frames that do.
  Samples at(int u, int v) const;

 private:
  const std::vector<ClipFrame>& frames_;
  std::vector<cv::Mat> covered_;  // CV_8UC1
};

// A shadow darkens all channels, and by about the same part of their linear values: a cloud that
// drifts off the sky is none.
bool darkenedAlike(const cv::Vec3b& shaded, const cv::Vec3b& lit);

// Are `values` darker than `lit`, by more than `step` of the brightness of `lit`, as a shadow makes
// them? @pre neither is empty
bool shadedAgainst(const Samples& lit, const Samples& values, double step);

// Leaves out the darker group if the values fall into two, and tells whether they do.
bool dropShaded(double step, Samples& values);

// Leaves out the darker of the two groups that the values fall into best.
void keepBrighter(Samples& values);

// Median per channel, then the mean of what lies around it. @param spread out: the largest
// channel's median absolute deviation. @pre values is not empty
cv::Vec3f robustMean(const Samples& values, float& spread);

}  // namespace calipso::render
