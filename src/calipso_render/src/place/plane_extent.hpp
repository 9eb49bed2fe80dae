#pragma once

#include <algorithm>
#include <opencv2/core.hpp>

namespace calipso::render {

constexpr int kNoPlane = -1;

// A plane all over the picture.
struct PlaneExtent {
  cv::Mat nearness;  // CV_32FC1, 0: not there
  cv::Mat farthest;  // CV_32FC1: of it and the pixels around, which the depth image may show
  cv::Mat goes_on;   // CV_8UC1: 255 where it may be behind objects

  // Part by which what is seen misses it: none within a pixel. Towards the horizon that is much.
  float miss(float seen, int u, int v) const {
    return std::max({0.0f, seen - nearness.at<float>(v, u), farthest.at<float>(v, u) - seen}) /
           seen;
  }
};

}  // namespace calipso::render
