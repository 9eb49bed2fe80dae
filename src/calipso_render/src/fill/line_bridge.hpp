#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "fill/lattice.hpp"

namespace calipso::render {

struct LineBridges {
  cv::Mat drawn;  // CV_8UC1: 255 where a pixel of the hole was drawn
  // CV_8UC1: the part of it that is the line; what is beside it is better filled like everything
  // else
  cv::Mat core;
  // CV_8UC1: of core, what passes before things that are not alike: no part of what is behind it
  cv::Mat before;
  cv::Mat origin;  // CV_16SC2: where it was copied from; (-1, -1) elsewhere
  // CV_8UC1: 255 where those lines are seen; now that they are whole, nothing else should look like
  // them
  cv::Mat lines;
};

// Continues straight edges and lines through a hole: those that enter it at two places, on one line
// and with the same colours across, are connected; one that meets such a connection within the hole
// goes on to it, unless another surface comes between; one whose surface ends there goes on to
// where that does. What lies a few pixels beside the line is drawn with it, mirrored from outside
// the hole, so that it keeps its grain.
// @param edges straightEdges() of the picture
// @param image CV_32FC3, code values; drawn upon
// @param hole, source CV_8UC1: to be filled; known
// @param surface InpaintParams::surface, of the hole's picture; may be empty
// @param lattice by which the picture repeats itself, may be nullptr: its lines are left to it
LineBridges bridgeLines(const std::vector<cv::Vec4f>& edges, const cv::Mat& hole,
                        const cv::Mat& source, const cv::Mat& surface, cv::Mat& image,
                        const Lattice* lattice = nullptr);

// The same of those edges alone that part two surfaces all the way, to be continued before anything
// is filled. Where the picture shows such an edge it tells more exactly than a depth image where the
// surfaces meet.
// @param surface of two sides of such an edge set by it, in the hole and beside what is seen of it
LineBridges bridgeBorders(const std::vector<cv::Vec4f>& edges, const cv::Mat& hole,
                          const cv::Mat& source, cv::Mat& surface, cv::Mat& image);

}  // namespace calipso::render
