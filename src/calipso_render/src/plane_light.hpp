#pragma once

#include <opencv2/core.hpp>

#include "calipso_render/visibility.hpp"
#include "plane_view.hpp"

namespace calipso::render {

// What the support planes see of a light, pixel by pixel: exactly where it changes quickly, interpolated over two pixels where
// it changes slowly, and at once for squares that are all lit or all shaded.
// @param skip CV_8UC1 over `rect`: 255 = not wanted; may be empty
// @param out CV_32FC1 over `rect`, 0..1; keeps its values where no plane is seen, and where not wanted
void planesInLight(const PlaneView& view, const Visibility& light, const cv::Rect& rect, const cv::Mat& skip, cv::Mat& out);

}  // namespace calipso::render
