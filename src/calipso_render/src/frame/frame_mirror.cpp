// The part of FrameCompositor that draws anew what support planes mirror.

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"
#include "frame/frame_compositor.hpp"
#include "place/plane_mirror.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr float kNoChange = 0.01f;  // of the brightness
constexpr float kDark = 0.01f;      // linear
constexpr int kInFront = 127;       // of a matte

float strongest(const cv::Vec3f& c) {
  return std::max({std::abs(c[0]), std::abs(c[1]), std::abs(c[2])});
}

}  // namespace

void FrameCompositor::findMirrored() {
  unmirrored_ = frame_.input.bgr;
  if (frame_.prepared.mirror.established() && frame_.at_key_camera) {
    mirrorAnew();
    if (place_.live != nullptr || frame_.movesInVideo())
      unmirrored_ = unmirroredCodes(frame_.prepared.mirror, frame_.input.bgr);
  }
  if (place_.live != nullptr)
    live_corrections_ = place_.live->corrections(unmirrored_, frame_.labels);
}

void FrameCompositor::mirrorAnew() {
  const PlaneMirror& mirror = frame_.prepared.mirror;
  std::vector<const Actor*> actors;
  std::vector<int> slots;
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    const int surface = frame_.objects[slot].surface;
    if (frame_.edited[surface] || !frame_.prepared.moves[surface])
      actors.push_back(&frame_.objects[slot].actor), slots.push_back(static_cast<int>(slot));
  }
  const Radiance radiance = [&](int i, const SurfacePoint& point) {
    return mirroredRadiance(frame_.prepared.appearances[frame_.objects[slots[i]].surface],
                            frame_.light, frame_.objects[slots[i]].look, point);
  };
  const MirrorImage image =
      mirrorImage(actors, radiance, frame_.params.planes, frame_.input.camera, mirror.off);
  mirrored_ = image.empty() ? cv::Mat(frame_.input.bgr.size(), CV_32FC3, cv::Scalar())
                            : addedBy(mirror, image);
  remirrored_ = cv::Mat::zeros(frame_.input.bgr.size(), CV_8U);
  const cv::Rect box =
      image.empty() ? mirror.key_box : mirror.key_box | reachedBy(image, mirror.slope);
#pragma omp parallel for schedule(static)
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      const cv::Vec3f &now = mirrored_.at<cv::Vec3f>(v, u),
                      &before = mirror.at_key.at<cv::Vec3f>(v, u);
      if (now == cv::Vec3f() && before == cv::Vec3f()) continue;
      const bool changed = strongest(now - before) >
                           kNoChange * (strongest(linearPixel(frame_.input.bgr, u, v)) + kDark);
      remirrored_.at<std::uint8_t>(v, u) = changed ? kChanged : 1;
    }
  }
  if (!frame_.params.matte.empty()) remirrored_.setTo(0, frame_.params.matte > kInFront);
}

cv::Vec3f FrameCompositor::unmirroredAt(int u, int v) const {
  cv::Vec3f colour = linearPixel(frame_.input.bgr, u, v);
  if (mirrored_.empty() || remirrored_.at<std::uint8_t>(v, u) == 0) return colour;
  colour -= frame_.prepared.mirror.at_key.at<cv::Vec3f>(v, u);
  return {std::max(0.0f, colour[0]), std::max(0.0f, colour[1]), std::max(0.0f, colour[2])};
}

// Adds what the planes mirror now to what a pixel shows without it. Where nothing changed it is the
// frame's own.
void FrameCompositor::addMirrored(int u, int v, Behind& behind) const {
  if (mirrored_.empty() || remirrored_.at<std::uint8_t>(v, u) == 0) return;
  if (behind.source == kOriginal && remirrored_.at<std::uint8_t>(v, u) != kChanged) {
    behind.colour = linearPixel(frame_.input.bgr, u, v);
    return;
  }
  const cv::Vec3f& now = mirrored_.at<cv::Vec3f>(v, u);
  if (behind.source == kOriginal || now != cv::Vec3f()) behind.source = kRendered;
  for (int c = 0; c < 3; ++c) behind.colour[c] = std::max(0.0f, behind.colour[c] + now[c]);
}

}  // namespace calipso::render
