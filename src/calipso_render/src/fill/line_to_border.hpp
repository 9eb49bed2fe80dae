#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "fill/line_ends.hpp"

namespace calipso::render {

// px that a line goes on in the hole up to where its surface ends, as the joint between two boards
// does at a curtain before them: where it leaves the hole neither is anything to be filled nor is
// its surface seen. Nothing if it is.
// @param hole, source CV_8UC1, of a single surface: to be filled; known
// @param most px
std::optional<float> wayToBorder(const LineEnd& end, const cv::Mat& hole, const cv::Mat& source,
                                 float most);

}  // namespace calipso::render
