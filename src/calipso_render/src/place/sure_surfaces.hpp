#pragma once

#include <opencv2/core.hpp>

#include "place/plane_edges.hpp"

namespace calipso::render {

// Where a plane is seen, or hidden and nearer to where it is than to anything else that does not
// meet it. CV_8UC1
// @param label PlaceSurfaces::label; hidden CV_8UC1, != 0: by an object
// @param seen CV_8SC1: the plane that every pixel shows, -1: none
// @param nothing CV_8UC1, != 0: so far away that the depth image says nothing
cv::Mat sureOf(const cv::Mat& label, const cv::Mat& hidden, const cv::Mat& seen,
               const cv::Mat& nothing, const Edges& edges);

}  // namespace calipso::render
