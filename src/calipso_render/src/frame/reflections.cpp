#include "frame/reflections.hpp"

#include <algorithm>
#include <cmath>

#include "place/plane_mirror.hpp"

namespace calipso::render {
namespace {

constexpr float kNoChange = 0.01f;  // of the brightness
constexpr float kDark = 0.01f;      // linear
constexpr int kInFront = 127;       // of a matte

float strongest(const cv::Vec3f& c) {
  return std::max({std::abs(c[0]), std::abs(c[1]), std::abs(c[2])});
}

}  // namespace

Reflections::Reflections(const StagedFrame& frame, const SeenPlace& place)
    : frame_(frame), unmirrored_(frame.input.bgr) {
  if (!frame.prepared.mirror.established() || !frame.at_key_camera) return;
  draw();
  if (place.live != nullptr || frame.movesInVideo())
    unmirrored_ = unmirroredCodes(frame.prepared.mirror, frame.input.bgr);
}

void Reflections::draw() {
  const PlaneMirror& mirror = frame_.prepared.mirror;
  std::vector<const Actor*> actors;
  std::vector<const StagedObject*> objects;
  for (const StagedObject& object : frame_.objects) {
    if (object.edited || !frame_.prepared.moves[object.surface])
      actors.push_back(&object.actor), objects.push_back(&object);
  }
  const Radiance radiance = [&](int i, const SurfacePoint& point) {
    const StagedObject& object = *objects[i];
    return mirroredRadiance(frame_.prepared.appearances[object.surface],
                            object.edited ? frame_.light : frame_.prepared.light.light, object.look,
                            point);
  };
  const MirrorImage image =
      mirrorImage(actors, radiance, frame_.params.planes, frame_.input.camera, mirror.off);
  now_ = image.empty() ? cv::Mat(frame_.input.bgr.size(), CV_32FC3, cv::Scalar())
                       : addedBy(mirror, image);
  mark(image.empty() ? mirror.key_box : mirror.key_box | reachedBy(image, mirror.slope));
}

// @param box beyond which nothing is mirrored, now or in the video
void Reflections::mark(const cv::Rect& box) {
  marks_ = cv::Mat::zeros(frame_.input.bgr.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      const cv::Vec3f &now = now_.at<cv::Vec3f>(v, u),
                      &before = frame_.prepared.mirror.at_key.at<cv::Vec3f>(v, u);
      if (now == cv::Vec3f() && before == cv::Vec3f()) continue;
      const float own = strongest(linearPixel(frame_.input.bgr, u, v));
      const bool changed = strongest(now - before) > kNoChange * (own + kDark);
      marks_.at<std::uint8_t>(v, u) = changed ? kChanged : kSame;
    }
  }
  if (!frame_.params.matte.empty()) marks_.setTo(0, frame_.params.matte > kInFront);
}

cv::Vec3f Reflections::takenOff(int u, int v) const {
  cv::Vec3f colour = linearPixel(frame_.input.bgr, u, v);
  if (now_.empty() || marks_.at<std::uint8_t>(v, u) == 0) return colour;
  colour -= frame_.prepared.mirror.at_key.at<cv::Vec3f>(v, u);
  return {std::max(0.0f, colour[0]), std::max(0.0f, colour[1]), std::max(0.0f, colour[2])};
}

cv::Vec3f Reflections::added(int u, int v) const {
  return now_.empty() || marks_.at<std::uint8_t>(v, u) == 0 ? cv::Vec3f()
                                                            : now_.at<cv::Vec3f>(v, u);
}

void Reflections::add(int u, int v, Pixel& pixel) const {
  if (now_.empty() || marks_.at<std::uint8_t>(v, u) == 0) return;
  if (pixel.source == kOriginal && marks_.at<std::uint8_t>(v, u) != kChanged) {
    pixel.colour = linearPixel(frame_.input.bgr, u, v);
    return;
  }
  const cv::Vec3f now = added(u, v);
  if (pixel.source == kOriginal || now != cv::Vec3f()) pixel.source = kRendered;
  for (int c = 0; c < 3; ++c) pixel.colour[c] = std::max(0.0f, pixel.colour[c] + now[c]);
}

}  // namespace calipso::render
