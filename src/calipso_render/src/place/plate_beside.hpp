#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// Which pixels of a view lie beside another view's picture. CV_8UC1, 255
// @param map CV_32FC2: where they lie in it (viewWarp())
cv::Mat besidePicture(const cv::Mat& map, const cv::Size& picture);

// The place from the cameras of further frames, for what lies beside the key frame's picture: the
// frame of which most does, then the one of which most is left, and so on. None before a camera
// that does not turn away.
// @param frames as they were taken, the key frame first
// @param nearness of the place, from the key frame's camera
std::vector<PlateBeside> platesBeside(const std::vector<ClipFrame>& frames, const cv::Mat& nearness,
                                      bool objects_move, const BackgroundParams& params);

}  // namespace calipso::render
