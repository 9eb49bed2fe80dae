#pragma once

#include "calipso_render/inpaint.hpp"

namespace calipso::render {

// inpaint() at the picture's own size.
InpaintResult inpaintAtSize(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                            const InpaintParams& params);

}  // namespace calipso::render
