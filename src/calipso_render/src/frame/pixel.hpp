#pragma once

#include <opencv2/core.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/renderer.hpp"

namespace calipso::render {

// A pixel on its way to the result.
struct Pixel {
  cv::Vec3f colour;    // linear
  float fresh = 0.0f;  // part of it that carries no camera noise yet
  Provenance source = kOriginal;
};

inline cv::Vec3f linearPixel(const cv::Mat& bgr, int u, int v) {
  const cv::Vec3b& c = bgr.at<cv::Vec3b>(v, u);
  const float* decoded = decodeTable();
  return {decoded[c[0]], decoded[c[1]], decoded[c[2]]};
}

}  // namespace calipso::render
