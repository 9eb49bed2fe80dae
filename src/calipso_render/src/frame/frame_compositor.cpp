#include "frame/frame_compositor.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"

namespace calipso::render {
cv::Vec3f FrameCompositor::shadowRatio(float sun, float sky) const {
  return prepared_.umbra * sky + (cv::Vec3f(1, 1, 1) - prepared_.umbra) * sun;
}

// How far a surface point of an edited object stays where the video shows it: 1 at rest, 0 moved.
float FrameCompositor::stillness(std::uint32_t id, float u, float v) const {
  if (observed_[VisibilityBuffer::objectOf(id)].points.empty()) return 0.0f;
  return 1.0f - smoothStep(kStillPx, kMovedPx, movement(id, u, v).norm());
}

// How far from its place in the video a surface point is seen, px. @pre the video has its object at
// rest
Eigen::Vector2f FrameCompositor::movement(std::uint32_t id, float u, float v) const {
  const int slot = VisibilityBuffer::objectOf(id), triangle = VisibilityBuffer::triangleOf(id);
  const Actor& actor = actors_[slot];
  const Eigen::Vector3i& t = actor.surface->triangles[triangle];
  const Eigen::Vector3f w = barycentric(actor.screen, triangle, u, v);
  Eigen::Vector2f moved = Eigen::Vector2f::Zero();
  for (int i = 0; i < 3; ++i) {
    moved += w[i] * (actor.screen.points[t[i]] - observed_[slot].points[t[i]]).head<2>();
  }
  return moved;
}

// Something without a model stands in front: it hid the object at the key frame, and goes on doing
// so.
bool FrameCompositor::hiddenByFront(int surface, int u, int v) const {
  const cv::Mat& front = fronts_[surface];
  return !front.empty() && front.at<std::uint8_t>(v, u) != 0;
}

// An edited object is drawn; another one only where the original picture does not show it.
bool FrameCompositor::isDrawn(std::uint32_t id, int u, int v) const {
  if (id == VisibilityBuffer::kNothing) return false;
  if (always_drawn_[VisibilityBuffer::objectOf(id)]) return true;
  const int surface = surface_of_slot_[VisibilityBuffer::objectOf(id)];
  if (hiddenByFront(surface, u, v)) return false;
  return edited_[surface] || removed_.at<std::uint8_t>(v - region_.y, u - region_.x) != 0;
}

// The part of a pixel that objects which stay cover: of one on their outline less than all.
float FrameCompositor::coverOfOthers(int u, int v) const {
  const EdgeCoverage::Pixel* edge = edges_->at(u, v);
  if (edge == nullptr) return labels_.at<std::uint8_t>(v, u) != 0 ? 1.0f : 0.0f;
  const auto stays = [&](std::uint32_t id) {
    return id != VisibilityBuffer::kNothing && !isDrawn(id, u, v);
  };
  return static_cast<float>(std::count_if(edge->ids.begin(), edge->ids.end(), stays)) /
         EdgeCoverage::kSamples;
}

FrameCompositor::Behind FrameCompositor::behindAt(int u, int v) const {
  const bool removed = removed_.at<std::uint8_t>(v - region_.y, u - region_.x) != 0;
  const float others = removed ? 0.0f : coverOfOthers(u, v);
  Behind own{linearPixel(frame_.bgr, u, v), 0.0f, kOriginal};
  if (others > 0.0f && labels_.at<std::uint8_t>(v, u) != 0) shadeOther(u, v, own);
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
  const bool invented = invented_.at<std::uint8_t>(v, u) != 0;
  cv::Vec3f now;
  const bool drifts = !drifts_.empty() && drifts_.at<std::uint8_t>(v, u) != 0;
  if (invented && !drifts && live_ != nullptr &&
      live_->at(unmirrored_, labels_, live_corrections_, prepared_.noise.deviation(1, 128.0f), u, v,
                now)) {
    for (int c = 0; c < 3; ++c) now[c] = linearFromRealCode(now[c]);
    return {now, 1.0f, kInvented};
  }
  return {plate_.at<cv::Vec3f>(v, u), 1.0f, invented ? kInvented : kSeenElsewhere};
}

FrameCompositor::Composed FrameCompositor::composedOf(const Drawn& drawn, int u, int v) const {
  const Behind behind = drawn.cover < 1.0f ? behindAt(u, v) : Behind{};
  return {drawn.cover * drawn.colour + (1.0f - drawn.cover) * behind.colour,
          drawn.cover + (1.0f - drawn.cover) * behind.fresh,
          drawn.cover > 0.0f ? kRendered : behind.source};
}

}  // namespace calipso::render
