#pragma once

#include <optional>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/light.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// What the sun's absence leaves of a support plane's brightness, from the places that the views'
// objects are known to shade: the median of picture over plate, per channel, what the objects hide
// of the sky taken off.
// @param views of the key frame's camera
// @return nullopt where too little of such shadows is seen
std::optional<cv::Vec3f> umbraInViews(const std::vector<View>& views,
                                      const std::vector<SupportPlane>& planes,
                                      const Background& plate, const Light& light);

}  // namespace calipso::render
