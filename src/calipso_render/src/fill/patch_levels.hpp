#pragma once

#include <vector>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {

// A picture with a hole, to be filled at one of several sizes.
struct FillLevel {
  cv::Mat image;                   // CV_32FC4: colour, and how lively it is around
  cv::Mat known;                   // CV_32FC1: part of a pixel that is known
  cv::Mat hole, source;            // CV_8UC1
  cv::Mat nearness, surface, sky;  // as InpaintParams'; may be empty
};

// The picture at half the size, a quarter and so on, the finest first.
std::vector<FillLevel> fillLevels(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source,
                                  const InpaintParams& params);

// The coarsest level that has a hole, as a thin one has none there, and, if wanted, whole patches to
// copy: a coarse pixel is source only if all of its own are.
int coarsestUseful(const std::vector<FillLevel>& levels, bool with_sources);

// How much nearer the ground is a row farther down, in the median.
float nearnessPerRow(const cv::Mat& nearness);

}  // namespace calipso::render
