#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_align/colour_model.hpp"

namespace calipso::align {

// What a label looks like near each place of a picture: small colour models on overlapping square
// windows, blended. Near its outline an object and its surroundings have few colours, so that local
// models part what global ones confuse. Immutable once fitted.
class LocalColourModel {
 public:
  // Learns from the pixels of `image` (CV_8UC3) under `mask` (CV_8U), in windows of 2 x `cell` px
  // every `cell` px. `everywhere` answers where a window has too few pixels.
  LocalColourModel(const cv::Mat& image, const cv::Mat& mask, int cell, int components,
                   ColourModel everywhere);

  // Negative log density of a colour at a pixel, nats.
  float cost(const cv::Vec3f& colour, int u, int v) const;

 private:
  std::optional<ColourModel> fitWindow(const cv::Mat& image, const cv::Mat& mask, int column,
                                       int row, int components) const;

  int cell_;
  cv::Size grid_;  // windows
  std::vector<std::optional<ColourModel>> windows_;
  ColourModel everywhere_;
};

}  // namespace calipso::align
