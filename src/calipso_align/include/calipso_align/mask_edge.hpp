#pragma once

#include <opencv2/core.hpp>

namespace calipso::align {

// Signed distance from the outline of a mask (CV_8U), px: CV_32F, negative inside.
cv::Mat signedDistance(const cv::Mat& mask);

// A mask made larger by so many pixels on every side.
cv::Mat grown(const cv::Mat& mask, int px);

// A mask without its rim, where flow mixes both sides; the mask itself where nothing else is left.
cv::Mat insideOf(const cv::Mat& mask, int rim_px = 4);

// What is clear about the background behind an outline: a picture of it, where `known` (CV_8U).
struct KnownBackground {
  cv::Mat image;  // CV_8UC3; empty: nothing is known
  cv::Mat known;
};

// Settles the pixels along the outline of a mask by how much of each the object covers,
//   alpha = (I - B).(F - B) / |F - B|^2,
// with F and B the mean colours close by on either side (B: the background itself where it is
// known). A pixel whose centre the object covers has alpha > 1/2. Where F and B differ too little
// for the noise, or a pixel is no mixture of them, it stays as it is.
// image  CV_8UC3
// noise  its standard deviation, grey levels
// mask   CV_8U 0 or 255, in and out
// Returns CV_8U 255 alpha, 0 or 255 away from the outline.
cv::Mat settleEdge(const cv::Mat& image, const KnownBackground& background, double noise,
                   cv::Mat& mask);

// The mask without the pieces that lie wholly outside of where it was expected, as long as these
// are the smaller part of it: shadows, and other things of its colours.
// @param mask, expected  CV_8U, 0 or 255, of equal size
cv::Mat withoutStrays(const cv::Mat& mask, const cv::Mat& expected);

}  // namespace calipso::align
