#include "calipso_render/renderer.hpp"

#include <algorithm>
#include <stdexcept>

#include "frame_compositor.hpp"

namespace calipso::render {

Renderer::Renderer(std::shared_ptr<const Prepared> prepared, const RenderParams& params)
    : prepared_(std::move(prepared)), params_(params), shadows_(std::make_unique<ShadowCache>()) {}

Renderer::~Renderer() = default;

FrameOutput Renderer::composite(const FrameInput& frame) {
  const bool touched = std::any_of(frame.objects.begin(), frame.objects.end(),
                                   [](const ObjectInFrame& o) { return o.edited || o.removed; });
  if (!touched) return {frame.bgr.clone(), cv::Mat::zeros(frame.bgr.size(), CV_8U)};
  const cv::Size expected(prepared_->camera.width, prepared_->camera.height);
  if (frame.bgr.size() != expected) {
    throw std::invalid_argument("frame is " + std::to_string(frame.bgr.cols) + " x " + std::to_string(frame.bgr.rows) +
                                ", but the clip was " + std::to_string(expected.width) + " x " +
                                std::to_string(expected.height) + "; play both at one size");
  }
  return FrameCompositor(*prepared_, params_, frame, *shadows_).run();
}

}  // namespace calipso::render
