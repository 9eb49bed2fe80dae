#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// A picture drawn out by what mirrors it being uneven: per pixel between levels of blur, each twice
// as wide as the one before.
class DrawnOut {
 public:
  static constexpr int kCoarsest = 32;  // px of the picture: a multiple of all levels' pixels

  // @param spread CV_32FC1: px along a column for each unit of slope; across: how much less it is
  // along a row
  DrawnOut(const cv::Mat& spread, float across, float slope);

  // @param values CV_32FC4: colour and cover
  cv::Mat operator()(const cv::Mat& values) const;

 private:
  // Wide levels are of a smaller picture, whose pixels are half as wide as the blur at most.
  struct Blurred;
  Blurred blurred(const cv::Mat& values, int level) const;
  cv::Range rowsAt(int level) const;

  float across_;
  cv::Mat level_;                      // CV_32F
  std::vector<int> lowest_, highest_;  // per row, whole levels
};

}  // namespace calipso::render
