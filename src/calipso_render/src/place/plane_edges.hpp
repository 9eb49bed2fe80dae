#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "place/place_relief.hpp"

namespace calipso::render {

// How planes meet that are seen on either side of their line: at an edge that stands out, as the sides of a box do (of
// two such the farther one is seen), or in a corner, as floor and wall.
enum Meeting : char { kApart, kStandsOut, kCorner };
using Edges = std::vector<std::vector<Meeting>>;

// By what is seen around the line where two planes meet: on either side the farther one, or the nearer one.
// @param seen CV_8SC1, of every pixel the plane, or -1
Edges findEdges(const std::vector<PicturePlane>& planes, const cv::Mat& seen);

// CV_8UC1: 255 on the line where two planes meet.
cv::Mat alongEdge(const PicturePlane& a, const PicturePlane& b, const cv::Size& size);

}  // namespace calipso::render
