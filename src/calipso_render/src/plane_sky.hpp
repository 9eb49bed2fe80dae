#pragma once

#include <opencv2/core.hpp>

#include "calipso_render/visibility.hpp"
#include "plane_view.hpp"
#include "square_mask.hpp"

namespace calipso::render {

// What support planes get of the sky's light. It changes slowly but close to a contact: measured on
// a grid that hangs on the picture and interpolated, and pixel by pixel where the grid's places differ.
// @param region of a picture of `picture` pixels
// @param skip where it is not wanted
// @return CV_8UC1 over `region`, lightLevel() of skyLight(); all where no plane is seen
cv::Mat planesUnderSky(const PlaneView& planes, const Visibility& sky, const cv::Size& picture,
                       const cv::Rect& region, const SquareMask& skip);

}  // namespace calipso::render
