#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/contour.hpp"

namespace calipso::align {

// A point of the picture's contour that the model is to meet.
struct TargetPoint {
  Eigen::Vector2d pixel;   // px, smoothed as far as the noise asks for
  Eigen::Vector2d normal;  // unit, from the object outwards
  double weight;           // length of contour it stands for times its confidence, px
  bool known;              // false: it may be met, but pulls nobody
  int loop, index;         // where it comes from: points[index] of loops[loop]
  bool foreign = false;    // true: no part of the model can be meant, nothing is paired with it
};

// The contour as the fit sees it: evenly spaced points with normals, and its noise level.
struct ContourTarget {
  std::vector<TargetPoint> points;
  double noise_px = 0.0;   // standard deviation of what the smoothing had to remove
  double length_px = 0.0;  // of all loops
  double known_length_px = 0.0;
};

// @throw std::invalid_argument naming the loop and what is wrong with it
ContourTarget makeContourTarget(const std::vector<ContourLoop>& loops, double spacing_px);

// 255 inside the outer loops and outside of the holes.
cv::Mat1b fillContour(const std::vector<ContourLoop>& loops, const cv::Size& size);

// The same without the contour's noise, which would fray the mask: where it had to be smoothed
// away, of the target's points.
cv::Mat1b fillTarget(const ContourTarget& target, const std::vector<ContourLoop>& loops,
                     const cv::Size& size);

}  // namespace calipso::align
