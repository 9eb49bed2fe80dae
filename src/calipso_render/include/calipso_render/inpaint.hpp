#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace calipso::render {

struct InpaintParams {
  int patch_radius = 3;        // px; patches are squares of 2 r + 1
  int coarse_iterations = 6;   // search and vote, at each level but the finest
  int fine_iterations = 2;
  int coarsest_side = 24;      // px; the pyramid ends there, or where the hole is a patch wide
  std::uint32_t seed = 1;
};

struct InpaintResult {
  cv::Mat image;   // CV_32FC3, as the input outside the hole
  cv::Mat origin;  // CV_16SC2: (u, v) in the input that each hole pixel was taken from; (-1, -1) outside
  bool patches_found = true;  // false: nothing to copy from, the hole was filled smoothly
};

// Fills a hole so that every patch that touches it looks like some patch elsewhere (Wexler et al.
// 2007), with PatchMatch as the search (Barnes et al. 2009), coarse to fine. A last vote copies whole
// source pixels instead of averaging, which keeps the surroundings' grain.
// @param image CV_32FC3, code values
// @param hole CV_8UC1, != 0: to be filled
// @param banned CV_8UC1, != 0: neither filled nor copied from; may be empty
InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params = {});

// Smooth fill (push-pull): weighted averages at ever coarser scales.
// @param weight CV_32FC1 in [0, 1]: how far each pixel is to be trusted
cv::Mat pushPull(const cv::Mat& image, const cv::Mat& weight);

}  // namespace calipso::render
