#pragma once

#include <opencv2/core.hpp>

#include "calipso_render/inpaint.hpp"
#include "fill/pattern.hpp"

namespace calipso::render {

// Which pixel each pixel of a hole is a copy of, so that every patch of the filled picture
// resembles one of the source (Wexler et al. 2007; Newson et al. 2017): coarse to fine, nearest
// patches (PatchMatch, Barnes et al. 2009) and weighted votes in turn, begun at the coarsest level
// from the rim inwards. Patches compare colour and how lively the picture is. At the finest level
// there is no vote: what is copied keeps its grain. Does not depend on the number of threads.
// @param image CV_32FC3, code values
// @param hole, source CV_8UC1: to be filled; may be copied from
// @param pattern copies are shifted by it
// @return CV_16SC2: (u, v); (-1, -1) outside the hole, and everywhere if no patch lies in the
//   source
cv::Mat patchOrigins(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source,
                     const Pattern& pattern, const InpaintParams& params);

}  // namespace calipso::render
