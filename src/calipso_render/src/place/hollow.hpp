#pragma once

#include <opencv2/core.hpp>

#include "place/place_relief.hpp"

namespace calipso::render {

// What lies in a bowl hides some of its inside, of which the depth image shows that it turns about
// an upright axis: height over the support plane as a function of the distance from the axis.
// What is hidden of it is filled as
//   log I = p(r) + s
//   I  linear colour     r  distance from the axis
//   p  the pattern that goes round, from the median of how log I changes with r
//   s  the shade, continued smoothly over the picture
// @param scenery CV_32FC1, 1/m, of what is no object; 0 unknown
// @param hole CV_8UC1: what is to be filled
// @param plate CV_32FC3, code values, in and out
// @return CV_8UC1: 255 where it was filled
cv::Mat fillHollows(const cv::Mat& scenery, const PlaceSurfaces& surfaces,
                    const SupportPlane& support, const Camera& camera, const cv::Mat& hole,
                    cv::Mat& plate);

}  // namespace calipso::render
