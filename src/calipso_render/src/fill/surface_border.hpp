#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "fill/line_ends.hpp"

namespace calipso::render {

// Two surfaces, one on each side of a straight edge that a hole interrupts.
struct SurfaceBorder {
  int left, right;  // labels, from `from` on
  int off;          // px on either side of the edge from where on the labels agree with it
};

// The surfaces that an edge parts on most of its way through the hole, and of what is seen of one of
// its ends: all along it the one, on the other side never that. What is hidden and no plane is a
// guess, which contradicts nothing. The labels of what lies almost in a plane waver.
// @param surface CV_8UC1, InpaintParams::surface @return nothing if there are none
std::optional<SurfaceBorder> borderAlong(const LineEnd& from, const LineEnd& to,
                                         const cv::Mat& surface);

// The edge tells more exactly than labels where the surfaces meet, and what guesses are.
void setSides(const SurfaceBorder& border, const LineEnd& from, const LineEnd& to,
              const cv::Mat& hole, cv::Mat& surface);

// Label at the pixel nearest to p; 0 outside of the picture.
int surfaceAt(const cv::Mat& surface, const cv::Point2f& p);

}  // namespace calipso::render
