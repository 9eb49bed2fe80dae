#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// The dark that contacts leave on walls, where the picture surely shows it, whatever becomes of the
// sun's shadows; walls that should show some and do not take none.
// @param actors the objects at the key frame @param picture CV_32FC3, the key frame, code values
// @return CV_8UC1: 255 where that dark is to be taken out
cv::Mat contactTraces(const std::vector<Actor>& actors, const cv::Mat& picture,
                      const RenderParams& params, Prepared& p);

}  // namespace calipso::render
