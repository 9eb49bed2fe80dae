#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

namespace calipso::flow {

// A part of a picture that keeps the picture's pixel coordinates.
struct ImageWindow {
  cv::Mat image;       // CV_32F
  cv::Point2d origin;  // picture coordinates of image(0, 0)
};

constexpr int kMostRadius = 10;  // px, of a patch

struct PatchParams {
  // 1..kMostRadius; the patch is a square of 2 r + 1 pixels: small, since shading bends large ones
  int radius_px = 4;
  int max_iterations = 12;
  double least_support = 0.4;   // share of the patch's pixels that must carry weight
  double converged_px = 0.005;  // an update smaller than this ends the iteration
  // Grey levels per pixel; a direction in which the patch varies by less gives no position.
  double least_gradient = 0.4;
  // True: a patch that varies in one direction only is matched across its stripes; its covariance
  // says that its position along them is not known.
  bool stripes = false;
};

struct PatchMatch {
  Eigen::Vector2d position;    // where the patch's centre lies in the target, px
  Eigen::Matrix2d covariance;  // of position, from the residual's variance, px^2
  double deviation;            // px, in the directions in which the position is known
  double correlation;          // weighted, normalised: 1 = the same up to gain and offset
};

// The pixels to be found again: the square around `at` of `gray`, as far as the square around
// `weight_at` of `weight` is 1 (0: the pixel does not belong to the object).
struct PatchSource {
  ImageWindow gray;
  Eigen::Vector2d at;  // px
  ImageWindow weight;
  Eigen::Vector2d weight_at;  // px
};

// Lucas-Kanade match of a patch to `target`, by inverse composition: the patch's normal matrix is
// factored once. Gain and offset of the brightness are free, so that shading may change. Nothing is
// returned where the patch leaves a picture, has too little support or texture, or does not settle.
// @param start   first guess of the position in the target, px
// @throw std::invalid_argument if the radius is out of range
std::optional<PatchMatch> matchPatch(const PatchSource& source, const ImageWindow& target,
                                     const Eigen::Vector2d& start, const PatchParams& params);

}  // namespace calipso::flow
