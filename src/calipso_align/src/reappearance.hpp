#pragma once

#include <opencv2/core.hpp>

#include "calipso_align/gaussian_mixture.hpp"
#include "calipso_align/mask_edge.hpp"

namespace calipso::align {

// Where a lost object may be. CV_8U, 0 or 255, of the picture's size, or empty.
struct Reappearance {
  cv::Mat mask;      // it is back
  cv::Mat suspects;  // pixels that may be a first strip of it
};

// Looks for an object that was lost: it left the picture, or went behind something, and may be back
// anywhere. Found is the largest piece of what the background cannot be and the object's colours
// explain.
// image       CV_8UC3
// background  of the whole picture; where it moves itself it tells nothing, and nothing is found
// taken       CV_8U, non-zero: other objects
// colours     of the object
// least_px    smaller pieces are none
Reappearance findAgain(const cv::Mat& image, const KnownBackground& background,
                       const cv::Mat& taken, const GaussianMixture& colours, int least_px);

}  // namespace calipso::align
