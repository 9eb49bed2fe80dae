// The part of FrameCompositor that stages a frame: who is where, and which pixels that can change.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "draw/side_by_side.hpp"
#include "frame/frame_compositor.hpp"

namespace calipso::render {
namespace {

constexpr int kRegionMargin = 8;  // px

// Bounding box of an object's pixels.
cv::Rect boxOf(const cv::Mat& labels, int index) {
  if (index < 0) return {};  // the video does not have it
  int left = labels.cols, right = -1, top = labels.rows, bottom = -1;
  for (int v = 0; v < labels.rows; ++v) {
    const std::uint8_t* row = labels.ptr<std::uint8_t>(v);
    const void* first = std::memchr(row, index, labels.cols);
    if (first == nullptr) continue;
    top = std::min(top, v), bottom = v;
    left = std::min(left, static_cast<int>(static_cast<const std::uint8_t*>(first) - row));
    const void* last = memrchr(row, index, labels.cols);
    right = std::max(right, static_cast<int>(static_cast<const std::uint8_t*>(last) - row));
  }
  return bottom < 0 ? cv::Rect() : cv::Rect({left, top}, cv::Point(right + 1, bottom + 1));
}

cv::Rect grown(const cv::Rect& r, int margin) {
  return {r.x - margin, r.y - margin, r.width + 2 * margin, r.height + 2 * margin};
}

}  // namespace

FrameCompositor::FrameCompositor(const Prepared& prepared, const RenderParams& params,
                                 const FrameInput& frame, ShadowCache& shadows, RestPicture& rest)
    : frame_(prepared, params, frame),
      place_(frame_),
      shadows_(shadows),
      rest_(rest),
      codec_(params.add_noise ? prepared.noise : NoiseModel(), frame.stamp_ns) {}

FrameOutput FrameCompositor::run() {
  prepareFrame();
  if (region_.empty())
    return {frame_.input.bgr.clone(), cv::Mat::zeros(frame_.input.bgr.size(), CV_8U)};
  findResidual();
  FrameOutput out{cv::Mat(frame_.input.bgr.size(), CV_8UC3),
                  cv::Mat(frame_.input.bgr.size(), CV_8U)};
#pragma omp parallel
  {
    Row row;
#pragma omp for schedule(dynamic, 8)
    for (int v = 0; v < frame_.input.bgr.rows; ++v) {
      std::memcpy(out.bgr.ptr(v), frame_.input.bgr.ptr(v),
                  3 * static_cast<std::size_t>(frame_.input.bgr.cols));
      std::memset(out.provenance.ptr(v), kOriginal, frame_.input.bgr.cols);
      if (v >= region_.y && v < region_.br().y) composeRow(v, row, out);
    }
  }
  softenOutlines(out);
  return out;
}

void FrameCompositor::prepareFrame() {
  findMirrored();
  prepareShadows();
  findShaded();
  findPassingShadows();
  chooseRegion();
  if (region_.empty()) return;
  findRemoved();
  drawVisibility();
  sideBySide(
      frame_.params.quality == Quality::kLive,
      [this] {
        sampleEdges();
        findMaps();
        findSurfaceSun();
        findStill();
      },
      [this] {
        findCovered();
        measureLight();
        findScreened();
        findRelit();
      });
}

void FrameCompositor::chooseRegion() {
  const cv::Size size = frame_.input.bgr.size();
  const cv::Rect all(0, 0, size.width, size.height);
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (!frame_.edited[i]) continue;
    shown_box_ |= boxOf(frame_.labels, frame_.prepared.surfaces[i].index);
  }
  if (!shown_box_.empty()) region_ |= grown(shown_box_, kRegionMargin);
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    const cv::Rect box = boundsOf(frame_.objects[slot].actor.screen, kRegionMargin, size);
    if (frame_.objects[slot].edited || may_be_shaded_[slot]) region_ |= box;
    drawn_box_ |= box;
  }
  region_ |= shadows_.bounds | shadows_.shaded_box | moved_bounds_;
  if (!passing_.empty()) region_ |= cv::boundingRect(passing_);
  if (!remirrored_.empty()) region_ |= cv::boundingRect(remirrored_ == kChanged);
  region_ &= all, drawn_box_ &= region_;
  shown_box_ |= shadows_.footprints;
  if (!shown_box_.empty())
    shown_box_ = grown(shown_box_, frame_.params.background.mask_margin_px) & region_;
}

void FrameCompositor::findMaps() {
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    const int surface = frame_.objects[slot].surface;
    const bool seen =
        frame_.edited[surface] ||
        !(boundsOf(frame_.objects[slot].actor.screen, 0, frame_.input.bgr.size()) & region_)
             .empty();
    maps_.push_back(seen ? SurfaceMaps(frame_.objects[slot].actor,
                                       frame_.prepared.appearances[surface], frame_.light,
                                       frame_.eye)
                         : SurfaceMaps());
  }
}

void FrameCompositor::drawVisibility() {
  for (const StagedObject& object : frame_.objects)
    always_drawn_.push_back(object.edited && place_.fronts[object.surface].empty());
  centre_.emplace(region_);
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot)
    centre_->draw(frame_.objects[slot].actor.screen, static_cast<int>(slot));
}

void FrameCompositor::sampleEdges() {
  edges_.emplace(*centre_, drawn_box_ - region_.tl());
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    if (frame_.objects[slot].edited)
      edges_->chooseSilhouette(frame_.objects[slot].actor.screen,
                               frame_.objects[slot].actor.surface->edges, *centre_);
  }
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot)
    edges_->draw(frame_.objects[slot].actor.screen, static_cast<int>(slot));
  edges_->settle(*centre_);
}

}  // namespace calipso::render
