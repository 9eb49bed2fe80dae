#pragma once

#include <opencv2/core.hpp>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {

// Moves the borders between copies to where they differ least (graph cuts by expansion moves,
// Boykov et al. 2001, with the seam cost of Kwatra et al. 2003).
// @param image CV_32FC3
// @param hole CV_8UC1, != 0: to be filled
// @param source CV_8UC1, != 0: may be copied
// @param known CV_8UC1, != 0: what the copies have to go on from
// @param params no copy goes on beyond the surface it is taken from, or from the sky or into it
// @param origin CV_16SC2: what each hole pixel is a copy of, (-1, -1) none; changed
void cutSeams(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source,
              const cv::Mat& known, const InpaintParams& params, cv::Mat& origin);

}  // namespace calipso::render
