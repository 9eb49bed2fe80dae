#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/relief.hpp"

namespace calipso::align {

// How reluctantly labels change between neighbouring pixels.
struct SmoothnessParams {
  float gamma = 20.0f;  // cost of an edge between equal colours, nats
  float floor = 0.02f;  // share of gamma that even the strongest image edge still costs
  // beta; 0: from the free pixels, which a narrow band makes too small
  float contrast_scale = 0.0f;
  float jump_scale = 0.0f;  // as beta, of the relief's jumps
};

// beta = 1 / (2 <|I_p - I_q|^2>) over the neighbours under a mask (CV_8U).
float contrastScale(const cv::Mat& image, const cv::Mat& mask);

// Gives every pixel that is free its cheapest label (Boykov, Veksler and Zabih 2001):
//
//   E(L) = sum_p costs[L_p](p) + sum_{pq} w_pq [L_p != L_q]
//   w_pq = gamma / |p - q| * (floor + (1 - floor) exp(-beta |I_p - I_q|^2))
//          exp(-beta_jump jump_pq^2)
//
// over the 8-neighbourhood, by expansion moves; with one object the result is the global optimum.
// labels  CV_8U, in: start and fixed surroundings; out: result
// free    CV_8U, non-zero where labels may change
// costs   CV_32F per label, 0 = background; a label whose cost is >= kForbidden is not taken
// image   CV_8UC3; all of one size
// relief  jumps count where it is registered; or null
// Deterministic. The pixels outside `free` act through their edges.
constexpr float kForbidden = 1e6f;
void cutLabels(const cv::Mat& image, const cv::Mat& free, const std::vector<cv::Mat>& costs,
               const SmoothnessParams& params, cv::Mat& labels, const Relief* relief = nullptr);

}  // namespace calipso::align
