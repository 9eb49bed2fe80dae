#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "frame/backdrop.hpp"
#include "frame/drawn_surfaces.hpp"
#include "frame/rest_picture.hpp"
#include "frame/revealed_place.hpp"
#include "frame/row_composer.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What is drawn of a frame in which objects stay where the key frame has them.
// @param frame of frameAtRest()
// @param removed CV_8UC1 over the region: pixels of the objects in it
// @param composer without a residual
RestPicture recordAtRest(const StagedFrame& frame, const DrawnSurfaces& surfaces,
                         const RevealedPlace& revealed, const Reflections& reflections,
                         const Backdrop& backdrop, const RowComposer& composer,
                         const cv::Mat& removed);

}  // namespace calipso::render
