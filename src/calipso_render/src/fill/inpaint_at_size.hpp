#pragma once

#include "calipso_render/inpaint.hpp"

namespace calipso::render {

// inpaint() at the picture's own size.
InpaintResult inpaintAtSize(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                            const InpaintParams& params);

// inpaint() of an image that has the pixels of a camera's pictures, but another size (a panorama of
// them): lines and patterns are as broad as they are there.
// @param picture size of theirs
InpaintResult inpaintAsIn(const cv::Size& picture, const cv::Mat& image, const cv::Mat& hole,
                          const cv::Mat& banned, const InpaintParams& params = {});

}  // namespace calipso::render
