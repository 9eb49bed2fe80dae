#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// Is most of a picture white or black, and more of it than of another one, as a flash or a cut leave
// it? It shows nothing of the place. @param bgr, usual CV_8UC3 or CV_32FC3, code values
bool isBlankAgainst(const cv::Mat& bgr, const cv::Mat& usual);

// The clip without further frames that are so against most of it: white ones would be taken for the
// place in a brighter light. nullopt: there are none.
std::optional<ClipSample> withoutBlankFrames(const ClipSample& clip);

}  // namespace calipso::render
