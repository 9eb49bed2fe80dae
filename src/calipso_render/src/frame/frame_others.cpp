// The part of FrameCompositor that deals with what no edit touches: objects that come into the
// shadow of edited ones, and scenery that hides them.

#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/frame_compositor.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

// of the nearness: what the depth image shows that much nearer stands in front
constexpr float kNearer = 1.02f;
constexpr int kRimReach = 3;  // px beyond a fitted surface that its mask may have more

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

}  // namespace

void FrameCompositor::findShaded() {
  may_be_shaded_.assign(frame_.objects.size(), false);
  std::vector<LightBox> boxes;
  for (const StagedObject& object : frame_.objects)
    boxes.emplace_back(object.actor.vertices, frame_.light.direction);
  for (std::size_t other = 0; other < frame_.objects.size(); ++other) {
    const Surface& surface = *frame_.objects[other].actor.surface;
    if (frame_.objects[other].edited || !surface.in_video) continue;
    for (std::size_t slot = 0; slot < frame_.objects.size() && !may_be_shaded_[other]; ++slot) {
      if (frame_.objects[slot].edited)
        may_be_shaded_[other] =
            boxes[slot].mayShade(boxes[other], static_cast<float>(frame_.params.sun_radius));
    }
    any_shaded_ = any_shaded_ || may_be_shaded_[other];
  }
}

// The surface of an object that stays, seen at a pixel of its mask; the mask may reach beyond the
// fitted surface.
std::optional<SurfacePoint> FrameCompositor::otherAt(int u, int v) const {
  const int label = frame_.labels.at<std::uint8_t>(v, u);
  for (int reach = 0; reach <= kRimReach; ++reach) {
    for (const cv::Point d : {cv::Point(0, 0), {1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const cv::Point at = cv::Point(u, v) + reach * d;
      if (!region_.contains(at)) continue;
      const std::uint32_t id = centre_->idAt(at.x, at.y);
      if (id == VisibilityBuffer::kNothing) continue;
      const int slot = VisibilityBuffer::objectOf(id);
      if (!may_be_shaded_[slot] || frame_.objects[slot].actor.surface->index != label) continue;
      return surfacePoint(frame_.objects[slot].actor, VisibilityBuffer::triangleOf(id),
                          static_cast<float>(u), static_cast<float>(v), frame_.eye);
    }
  }
  return std::nullopt;
}

// Another object's own pixel, darkened where an edited object takes sun away that it had in the
// video.
void FrameCompositor::shadeOther(int u, int v, Behind& behind) const {
  const std::optional<SurfacePoint> p = otherAt(u, v);
  if (!p || p->normal.dot(frame_.light.direction) <= 0.0f) return;
  const float now = moved_shadow_->visibility(p->position, p->normal);
  const float before =
      shadows_.originals ? shadows_.originals->visibility(p->position, p->normal) : 1.0f;
  if (before - now < kSameShadow) return;
  const float others = shadows_.others->visibility(p->position, p->normal);
  const cv::Vec3f back = cv::Vec3f::all(kThrownBack);
  const cv::Vec3f lit = diffuseShading(frame_.light, p->normal, others * before, p->seen, back);
  const cv::Vec3f shaded = diffuseShading(frame_.light, p->normal, others * now, p->seen, back);
  for (int c = 0; c < 3; ++c)
    behind.colour[c] *= std::min(1.0f, shaded[c] / std::max(lit[c], 1e-4f));
  behind.source = kRendered;
}

// Where the depth image or the user's matte puts something before what is drawn, with a soft edge.
void FrameCompositor::findScreened() {
  if ((frame_.prepared.scenery.empty() && frame_.params.matte.empty()) || !frame_.at_key_camera)
    return;
  screened_ = frame_.params.matte.empty() ? cv::Mat::zeros(region_.size(), CV_8U)
                                          : frame_.params.matte(region_).clone();
  if (frame_.prepared.scenery.empty()) return;
  const cv::Mat scenery = frame_.prepared.scenery(region_);
  cv::Mat drawn = cv::Mat::zeros(region_.size(), CV_32F), hidden;
  for (int v = 0; v < region_.height; ++v) {
    const std::uint32_t* ids = centre_->ids(v);
    for (int u = 0; u < region_.width; ++u) {
      const bool edited = ids[u] != VisibilityBuffer::kNothing && frame_.objectOf(ids[u]).edited;
      if (edited) drawn.at<float>(v, u) = centre_->nearness(v)[u];
    }
  }
  cv::dilate(drawn, drawn, cv::Mat::ones(3, 3, CV_8U));
  hidden = (scenery > kNearer * drawn) & (drawn > 0.0f);
  cv::blur(hidden, hidden, {3, 3});
  hidden.setTo(0, drawn == 0.0f);
  cv::max(screened_, hidden, screened_);
}

}  // namespace calipso::render
