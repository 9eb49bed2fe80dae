#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_scene/camera.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {

// true: both cameras see the same picture of a resting world.
bool sameView(const Camera& a, const Camera& b);

// Where each pixel of `to` lies in the picture of `from` (CV_32FC2, for cv::remap), the place being
// the support planes and, beyond them, a scene infinitely far away.
cv::Mat viewWarp(const std::vector<SupportPlane>& planes, const Camera& from, const Camera& to);

}  // namespace calipso::render
