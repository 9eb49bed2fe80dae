#pragma once

#include <calipso_scene/camera.hpp>
#include <opencv2/core.hpp>

namespace calipso::flow {

// One picture of the video. Immutable once made; copies share the pixels.
struct Frame {
  double time = 0.0;  // s
  cv::Mat gray;       // CV_32F, 0..255, lightly smoothed (see makeFrame)
  Camera camera;      // intrinsics and pose at `time`
  cv::Mat thumbnail;  // CV_32F, small: cuts of the video show in it
};

// Converts an 8-bit grey or BGR picture. The picture is smoothed by a Gaussian of 0.7 px, so that
// bilinear sampling has no bias towards whole pixels.
// @throw std::invalid_argument when the picture is empty, of another type or of another size than
//   `camera` says
Frame makeFrame(double time, const cv::Mat& picture, const Camera& camera);

// The frame at a size `factor` times smaller (what does not fill a pixel is cut off), its thumbnail
// the same.
Frame reduced(const Frame& frame, int factor);

}  // namespace calipso::flow
