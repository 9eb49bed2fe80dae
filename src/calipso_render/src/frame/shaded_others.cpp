#include "frame/shaded_others.hpp"

#include <algorithm>

namespace calipso::render {
namespace {

constexpr float kSameShadow = 1.0f / 64;  // of visibility: no visible change
constexpr int kRimReach = 3;              // px beyond a fitted surface that its mask may have more

// Extent of points along two axes across the light, and along it.
struct LightBox {
  Eigen::Array3f low = Eigen::Array3f::Constant(1e9f), high = Eigen::Array3f::Constant(-1e9f);

  LightBox(const Points& points, const Eigen::Vector3f& light) {
    Eigen::Matrix3f axes;
    axes.row(0) = light.unitOrthogonal(), axes.row(1) = light.cross(light.unitOrthogonal()),
    axes.row(2) = light;
    for (const Eigen::Vector3f& p : points)
      low = low.min((axes * p).array()), high = high.max((axes * p).array());
  }
  bool mayShade(const LightBox& other, float sun_radius) const {
    const float spread = sun_radius * std::max(0.0f, high[2] - other.low[2]);
    return (low.head<2>() - spread < other.high.head<2>()).all() &&
           (high.head<2>() + spread > other.low.head<2>()).all() && high[2] > other.low[2];
  }
};

// Edited objects where they are now, and where the video has at rest those that have left.
std::vector<LightBox> shadingBoxes(const StagedFrame& frame) {
  std::vector<LightBox> boxes;
  for (const StagedObject& object : frame.objects) {
    if (frame.casts(object.surface))
      boxes.emplace_back(object.actor.vertices, frame.light.direction);
  }
  for (std::size_t i = 0; i < frame.moved.size(); ++i) {
    const Surface& s = frame.prepared.surfaces[i];
    if (frame.moved[i] && s.in_video && !frame.prepared.moves[i])
      boxes.emplace_back(s.key_vertices, frame.light.direction);
  }
  return boxes;
}

}  // namespace

ShadedOthers::ShadedOthers(const StagedFrame& frame, const MovedShadow& moved,
                           const RestingLight& resting)
    : frame_(frame), moved_(moved), resting_(resting), maybe_(frame.objects.size(), false) {
  const std::vector<LightBox> shading = shadingBoxes(frame);
  for (std::size_t other = 0; other < maybe_.size(); ++other) {
    const Actor& actor = frame.objects[other].actor;
    if (frame.objects[other].edited || !actor.surface->in_video) continue;
    const LightBox box(actor.vertices, frame.light.direction);
    maybe_[other] = std::any_of(shading.begin(), shading.end(), [&](const LightBox& s) {
      return s.mayShade(box, frame.light.angular_radius);
    });
    any_ = any_ || maybe_[other];
  }
}

// The surface of an object that stays, seen at a pixel of its mask; the mask may reach beyond the
// fitted surface.
std::optional<SurfacePoint> ShadedOthers::pointAt(const VisibilityBuffer& seen, int u,
                                                  int v) const {
  const int label = frame_.labels.at<std::uint8_t>(v, u);
  for (int reach = 0; reach <= kRimReach; ++reach) {
    for (const cv::Point d : {cv::Point(0, 0), {1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const cv::Point at = cv::Point(u, v) + reach * d;
      if (!seen.region().contains(at)) continue;
      const std::uint32_t id = seen.idAt(at.x, at.y);
      if (id == VisibilityBuffer::kNothing) continue;
      const int slot = VisibilityBuffer::objectOf(id);
      if (!maybe_[slot] || frame_.objects[slot].actor.surface->index != label) continue;
      return surfacePoint(frame_.objects[slot].actor, VisibilityBuffer::triangleOf(id),
                          static_cast<float>(u), static_cast<float>(v), frame_.eye);
    }
  }
  return std::nullopt;
}

void ShadedOthers::shade(const VisibilityBuffer& seen, int u, int v, Pixel& pixel) const {
  const std::optional<SurfacePoint> p = pointAt(seen, u, v);
  if (!p || p->normal.dot(frame_.light.direction) <= 0.0f) return;
  const float now = moved_.sun->visibility(p->position, p->normal);
  const float before = resting_.originals() != nullptr
                           ? resting_.originals()->visibility(p->position, p->normal)
                           : 1.0f;
  // Light is given back only if the shadow was there: where the sun is not sure it may be elsewhere.
  if (before - now < kSameShadow &&
      (now - before < kSameShadow || !frame_.prepared.light.confirmed()))
    return;
  float others = resting_.others().visibility(p->position, p->normal);
  if (frame_.hasSunOfVideo())
    others *= frame_.prepared.unseen_shade.visibility(p->position, p->normal);
  const cv::Vec3f back = cv::Vec3f::all(kThrownBack);
  const cv::Vec3f was = diffuseShading(frame_.light, p->normal, others * before, p->seen, back),
                  is = diffuseShading(frame_.light, p->normal, others * now, p->seen, back);
  for (int c = 0; c < 3; ++c) pixel.colour[c] *= is[c] / std::max(was[c], 1e-4f);
  pixel.source = kRendered;
}

}  // namespace calipso::render
