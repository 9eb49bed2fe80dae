#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// The offsets by which a picture repeats itself most: every patch's nearest match elsewhere, counted
// (He and Sun 2012, "Statistics of patch offsets for image completion"). With each comes its opposite.
// Counts are weighed by how many patches have such a partner at all, and by how much of the hole it can fill.
// @param image CV_32FC3; source CV_8UC1, != 0: may be copied from, patches lie inside it; hole CV_8UC1
// @param shortest px; nearer matches say only that the picture is smooth
// @return at most `most`, the best first; empty if no patch has a match
std::vector<cv::Point> dominantOffsets(const cv::Mat& image, const cv::Mat& source, const cv::Mat& hole, double shortest, int most, std::uint32_t seed);

// Offsets along lines that run more or less level, as ground, walls and horizons do: for evenly spread widths the
// height at which the hole's surroundings continue best.
std::vector<cv::Point> levelOffsets(const cv::Mat& image, const cv::Mat& source, const cv::Mat& hole, int most);

// Where a hole's pixel finds a source at an offset: CV_8UC1, 255.
cv::Mat copyable(const cv::Mat& source, const cv::Point& offset);

}  // namespace calipso::render
