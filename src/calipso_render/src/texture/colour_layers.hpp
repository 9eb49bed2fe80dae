#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Colours laid one over the other: each takes up a part of what those before it left open.
struct Layers {
  cv::Vec3f sum;
  float open = 1.0f, most = 0.0f;
  int count = 0, strongest = -1;  // layers so far; the one that took up most

  void add(const cv::Vec3f& colour, float part) {
    sum += colour * (open * part);
    if (open * part > most) most = open * part, strongest = count;
    open *= 1.0f - part;
    ++count;
  }
};

}  // namespace calipso::render
