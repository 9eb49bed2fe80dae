#include "calipso_render/renderer.hpp"

#include <algorithm>
#include <stdexcept>

#include "frame_compositor.hpp"

namespace calipso::render {

Renderer::Renderer(std::shared_ptr<const Prepared> prepared, const RenderParams& params)
    : prepared_(std::move(prepared)), params_(params), shadows_(std::make_unique<ShadowCache>()), rest_(std::make_unique<RestPicture>()) {}

Renderer::~Renderer() = default;

// A copy is drawn like the object it was made from.
void Renderer::addCopies(const FrameInput& frame) {
  const auto find = [this](const std::string& name) {
    const std::vector<Surface>& all = prepared_->surfaces;
    return std::find_if(all.begin(), all.end(), [&](const Surface& s) { return s.name == name; }) - all.begin();
  };
  for (const ObjectInFrame& o : frame.objects) {
    const std::size_t count = prepared_->surfaces.size();
    const std::size_t from = static_cast<std::size_t>(find(o.source));
    if (o.source.empty() || static_cast<std::size_t>(find(o.name)) < count) continue;
    if (from == count) throw std::invalid_argument("'" + o.name + "' is a copy of '" + o.source + "', which has no model");
    auto more = std::make_shared<Prepared>(*prepared_);
    Surface surface = more->surfaces[from];
    surface.name = o.name;
    surface.index = -1;
    surface.in_video = false;
    more->surfaces.push_back(std::move(surface));
    more->moves.push_back(true);
    more->appearances.push_back(more->appearances[from]);
    more->fronts.emplace_back();
    more->footprints.emplace_back();
    prepared_ = std::move(more);
  }
}

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
  addCopies(frame);
  return FrameCompositor(*prepared_, params_, frame, *shadows_, *rest_).run();
}

}  // namespace calipso::render
