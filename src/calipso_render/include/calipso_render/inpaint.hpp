#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace calipso::render {

struct InpaintParams {
  int repeats = 14;           // offsets by which the picture repeats itself most, near by and again across the hole
  int levels = 24;            // offsets along level lines
  int sweeps = 2;             // of alpha expansion at the coarsest level
  int coarsest_hole = 4000;   // px; the pyramid ends where the hole has no more
  int coarsest_side = 24;     // px; or where the picture has no more
  std::uint32_t seed = 1;
};

struct InpaintResult {
  cv::Mat image;   // CV_32FC3, as the input outside the hole
  cv::Mat origin;  // CV_16SC2: (u, v) in the input that each hole pixel is a copy of; (-1, -1) elsewhere
  bool patches_found = true;  // false: nothing to copy from, the hole was filled smoothly
};

// Fills a hole with copies of its surroundings, whole areas shifted by the offsets at which the picture repeats itself
// (He and Sun 2012), with seams by graph cuts where they show least, coarse to fine, and evened out in the gradient
// domain. Copies keep the surroundings' grain and their lines.
// @param image CV_32FC3, code values
// @param hole CV_8UC1, != 0: to be filled
// @param banned CV_8UC1, != 0: neither filled nor copied from; may be empty
InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params = {});

// Smooth fill (push-pull): weighted averages at ever coarser scales.
// @param weight CV_32FC1 in [0, 1]: how far each pixel is to be trusted
cv::Mat pushPull(const cv::Mat& image, const cv::Mat& weight);

}  // namespace calipso::render
