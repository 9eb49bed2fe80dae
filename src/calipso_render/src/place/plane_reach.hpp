#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

constexpr float kOnPlane = 0.01f;  // of the nearness: what is seen so near to a plane is on it

// Where a plane goes on that is hidden: in its reach, and within its straight outlines that run
// into what hides it; without such nearer to where it is seen than to where something farther is
// seen in its place.
// @param plane CV_32FC1, 1/m: how near it is, 0: not there
// @param farthest CV_32FC1, 1/m, of it and the pixels around, which the scenery may show
// @param scenery CV_32FC1, 1/m, of what is no object; 0 unknown
// @param taken CV_8UC1, != 0: another plane is seen, which it may well pass through
// @param beyond CV_8UC1, != 0: a plane is seen with which it ends at an edge: that says where
// @param edge CV_8UC1, != 0: hidden, there it meets such a plane that goes on
// @param nothing CV_8UC1, != 0: so far away that the depth image says nothing
// @return CV_8UC1
cv::Mat goesOn(const cv::Mat& plane, const cv::Mat& farthest, const cv::Mat& scenery,
               const cv::Mat& taken, const cv::Mat& beyond, const cv::Mat& edge,
               const cv::Mat& nothing);

}  // namespace calipso::render
