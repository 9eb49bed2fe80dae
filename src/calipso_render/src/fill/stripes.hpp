#pragma once

#include <opencv2/core.hpp>
#include <optional>

namespace calipso::render {

constexpr double kStripesLevel = 40.0;  // px (deviation) of the mean that is taken off first

// The direction in which stripes go on from one side of a hole to the other, as the borders of a
// rug and the mouldings of a wall do: lines along it have about the same mean colour on both sides,
// and another one than the lines beside them. Nothing where there are none.
// @param image CV_32FC3, code values; hole, known CV_8UC1
// @return radians from the rows, in [-pi/2, pi/2]
std::optional<double> stripesAcross(const cv::Mat& image, const cv::Mat& hole,
                                    const cv::Mat& known);

}  // namespace calipso::render
