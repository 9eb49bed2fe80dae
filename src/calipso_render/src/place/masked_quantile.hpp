#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// The value below which `share` (0 to 1) of those under a mask lie; 0 where there are none.
// @param values CV_32FC1; mask CV_8UC1
inline float quantileOf(const cv::Mat& values, const cv::Mat& mask, double share) {
  std::vector<float> all;
  for (int v = 0; v < values.rows; ++v) {
    for (int u = 0; u < values.cols; ++u) {
      if (mask.at<std::uint8_t>(v, u) != 0) all.push_back(values.at<float>(v, u));
    }
  }
  if (all.empty()) return 0.0f;
  const std::size_t below = static_cast<std::size_t>(share * static_cast<double>(all.size())),
                    at = std::min(below, all.size() - 1);
  std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(at), all.end());
  return all[at];
}

}  // namespace calipso::render
