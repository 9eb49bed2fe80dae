#include "frame/frame_compositor.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"

namespace calipso::render {
cv::Vec3f FrameCompositor::shadowRatio(float sun, float sky) const {
  return frame_.prepared.umbra * sky + (cv::Vec3f(1, 1, 1) - frame_.prepared.umbra) * sun;
}

// An edited object is drawn; another one only where the original picture does not show it.
bool FrameCompositor::isDrawn(std::uint32_t id, int u, int v) const {
  if (id == VisibilityBuffer::kNothing) return false;
  if (always_drawn_[VisibilityBuffer::objectOf(id)]) return true;
  const int surface = frame_.objectOf(id).surface;
  if (place_.hides(surface, u, v)) return false;
  return frame_.edited[surface] || removed_.at<std::uint8_t>(v - region_.y, u - region_.x) != 0;
}

// The part of a pixel that objects which stay cover: of one on their outline less than all.
float FrameCompositor::coverOfOthers(int u, int v) const {
  const EdgeCoverage::Pixel* edge = edges_->at(u, v);
  if (edge == nullptr) return frame_.labels.at<std::uint8_t>(v, u) != 0 ? 1.0f : 0.0f;
  const auto stays = [&](std::uint32_t id) {
    return id != VisibilityBuffer::kNothing && !isDrawn(id, u, v);
  };
  return static_cast<float>(std::count_if(edge->ids.begin(), edge->ids.end(), stays)) /
         EdgeCoverage::kSamples;
}

FrameCompositor::Behind FrameCompositor::behindAt(int u, int v) const {
  const bool removed = removed_.at<std::uint8_t>(v - region_.y, u - region_.x) != 0;
  const float others = removed ? 0.0f : coverOfOthers(u, v);
  Behind own{linearPixel(frame_.input.bgr, u, v), 0.0f, kOriginal};
  if (others > 0.0f && frame_.labels.at<std::uint8_t>(v, u) != 0) shadeOther(u, v, own);
  if (others == 1.0f) return own;
  const Behind ground = groundAt(u, v, removed);
  if (others == 0.0f || ground.source == kOriginal) return others == 0.0f ? ground : own;
  return {others * own.colour + (1.0f - others) * ground.colour, (1.0f - others) * ground.fresh,
          ground.source};
}

// What a pixel shows where no object is.
FrameCompositor::Behind FrameCompositor::groundAt(int u, int v, bool removed) const {
  Behind behind = shadowedAt(u, v, removed);
  addMirrored(u, v, behind);
  return behind;
}

// The same without what the planes mirror now.
FrameCompositor::Behind FrameCompositor::shadowedAt(int u, int v, bool removed) const {
  Behind behind{unmirroredAt(u, v), 0.0f, kOriginal};
  if (removed) behind = revealedAt(u, v);
  const cv::Point at = cv::Point(u, v) - region_.tl();
  if (!relightable_.at(u, v) || takes_light_.at<std::uint8_t>(at) == 0) return behind;
  const int sun = sun_now_.at<std::uint8_t>(at), sun_before = sun_before_.at<std::uint8_t>(at);
  const int sky = sky_now_.at<std::uint8_t>(at), sky_before = sky_before_.at<std::uint8_t>(at);
  const cv::Vec3f now = shadowRatio(kPerLevel * sun, kPerLevel * sky),
                  before = shadowRatio(kPerLevel * sun_before, kPerLevel * sky_before);
  if (removed) {
    behind.colour = behind.colour.mul(now);
    return behind;
  }
  // Darkened further or seeing a little more sky, a pixel keeps its own grain; what the sun newly
  // reaches must come from the plate.
  const float from_plate = relit_.at<std::uint8_t>(at) / 255.0f;
  if (from_plate == 0.0f && std::abs(sun - sun_before) + std::abs(sky - sky_before) < kSameLevels)
    return behind;
  cv::Vec3f darkened = behind.colour;
  for (int c = 0; c < 3; ++c)
    darkened[c] *= std::min(kBrightest, now[c] / std::max(before[c], kDarkest));
  const Behind revealed = revealedAt(u, v);
  behind.colour = from_plate * revealed.colour.mul(now) + (1.0f - from_plate) * darkened;
  behind.fresh = from_plate * revealed.fresh;
  behind.source = from_plate > 0.5f ? revealed.source : kRendered;
  return behind;
}

// What comes to light where an object or its shadow was.
FrameCompositor::Behind FrameCompositor::revealedAt(int u, int v) const {
  const bool invented = place_.invented.at<std::uint8_t>(v, u) != 0;
  cv::Vec3f now;
  const bool drifts = !place_.drifts.empty() && place_.drifts.at<std::uint8_t>(v, u) != 0;
  if (invented && !drifts && place_.live != nullptr &&
      place_.live->at(unmirrored_, frame_.labels, live_corrections_,
                      frame_.prepared.noise.deviation(1, 128.0f), u, v, now)) {
    for (int c = 0; c < 3; ++c) now[c] = linearFromRealCode(now[c]);
    return {now, 1.0f, kInvented};
  }
  return {place_.plate.at<cv::Vec3f>(v, u), 1.0f, invented ? kInvented : kSeenElsewhere};
}

FrameCompositor::Composed FrameCompositor::composedOf(const Drawn& drawn, int u, int v) const {
  const Behind behind = drawn.cover < 1.0f ? behindAt(u, v) : Behind{};
  return {drawn.cover * drawn.colour + (1.0f - drawn.cover) * behind.colour,
          drawn.cover + (1.0f - drawn.cover) * behind.fresh,
          drawn.cover > 0.0f ? kRendered : behind.source};
}

}  // namespace calipso::render
