#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// The object that covers most of the key frame, turned in its place by eighths about the vertical,
// eight crops of the final picture side by side: no figure judges what a camera never saw, an eye
// does. Empty where the object is too large to be turned before the camera.
// @param key_frame every object at rest.
cv::Mat turntable(const std::shared_ptr<const Prepared>& prepared, RenderParams params,
                  const FrameInput& key_frame);

}  // namespace calipso::render
