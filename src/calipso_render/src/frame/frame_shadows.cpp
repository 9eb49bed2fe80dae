// The part of FrameCompositor that prepares who casts shadows: maps or rays towards sun and sky,
// and what they reach.

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "calipso_render/ray_shadow.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "draw/side_by_side.hpp"
#include "frame/frame_compositor.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr int kShadowMapSide = 512;     // texels, live
constexpr int kShadowBoundsMargin = 8;  // px
constexpr float kReliefMargin = 0.01f;  // m: planes have boxes without thickness
// of the height: a vertex that far below its plane still shades it
constexpr float kHeightTolerance = 0.02f;

// The sky over a support plane as one wide light: near contact an object hides much of it.
std::unique_ptr<Visibility> skyShadowOf(const std::vector<Occluder>& all,
                                        const RenderParams& params) {
  const std::vector<Occluder> occluders = params.planes.empty() ? std::vector<Occluder>{} : all;
  const Eigen::Vector3d up = params.planes.empty() ? params.up : params.planes.front().normal;
  if (params.quality == Quality::kFinal)
    return std::make_unique<RayShadow>(occluders, up, RayShadow::Params{kSkyRadius, 48});
  return std::make_unique<SkyMap>(occluders, up, SkyMap::Params());
}

std::unique_ptr<Visibility> shadowOf(const std::vector<Occluder>& occluders, const Light& light,
                                     const RenderParams& params) {
  const Eigen::Vector3d direction = light.direction.cast<double>();
  if (params.quality == Quality::kFinal)
    return std::make_unique<RayShadow>(occluders, direction,
                                       RayShadow::Params{params.sun_radius, 24});
  return std::make_unique<ShadowMap>(occluders, direction,
                                     ShadowMap::Params{kShadowMapSide, params.sun_radius, 16});
}

std::uint8_t levelAt(const cv::Mat& picture, int u, int v) {
  return picture.empty() ? 255 : picture.at<std::uint8_t>(v, u);
}

}  // namespace

void FrameCompositor::prepareShadows() {
  std::vector<Occluder> moved, others, originals;
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    auto& list = frame_.objects[slot].edited ? moved : others;
    list.push_back({&frame_.objects[slot].actor.vertices,
                    &frame_.objects[slot].actor.surface->triangles,
                    frame_.objects[slot].actor.surface->winding});
  }
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    const Surface& s = frame_.prepared.surfaces[i];
    if (frame_.edited[i] && !frame_.prepared.moves[i] && s.in_video)
      originals.push_back({&s.key_vertices, &s.triangles, s.winding});
  }
  sideBySide(
      frame_.params.quality == Quality::kLive,
      [&] { moved_shadow_ = shadowOf(moved, frame_.light, frame_.params); },
      [&] {
        moved_sky_ = skyShadowOf(moved, frame_.params);
        for (const Occluder& o : moved) moved_bounds_ |= shadowBounds(*o.vertices, frame_.light);
      });
  std::vector<Points> others_now;
  for (const Occluder& o : others) others_now.push_back(*o.vertices);
  const bool same = shadows_.others && shadows_.edited == frame_.edited &&
                    shadows_.sun == frame_.light.direction &&
                    sameView(shadows_.camera, frame_.input.camera);
  const bool others_rest = shadows_.others_vertices == others_now;
  if (!same || !others_rest) cacheOthers(others);
  if (!same) cacheOriginals(originals);
  if (!same || !others_rest) cacheShaded(), cacheBefore();
  shadows_.edited = frame_.edited, shadows_.camera = frame_.input.camera,
  shadows_.sun = frame_.light.direction;
  shadows_.others_vertices = std::move(others_now);
}

void FrameCompositor::cacheOthers(const std::vector<Occluder>& others) {
  shadows_.others = shadowOf(others, frame_.light, frame_.params);
  cv::Rect bounds;
  for (const Occluder& o : others) bounds |= shadowBounds(*o.vertices, frame_.light);
  shadows_.others_sun = bounds.empty() ? cv::Mat() : sunOver(*shadows_.others, bounds, nullptr);
  shadows_.others_sky.release();
  if (others.empty()) return;
  const auto sky = skyShadowOf(others, frame_.params);
  shadows_.others_sky =
      skyLevels(skyOver(*sky, {{0, 0}, frame_.input.bgr.size()}, SquareMask()), *sky);
}

void FrameCompositor::cacheOriginals(const std::vector<Occluder>& originals) {
  const cv::Rect whole({0, 0}, frame_.input.bgr.size());
  shadows_.bounds = {};
  for (const Occluder& o : originals)
    shadows_.bounds |= shadowBounds(*o.vertices, frame_.prepared.light.light);
  shadows_.originals =
      originals.empty() ? nullptr : shadowOf(originals, frame_.prepared.light.light, frame_.params);
  shadows_.sunless = SquareMask(whole);
  shadows_.originals_sun = shadows_.bounds.empty()
                               ? cv::Mat()
                               : sunOver(*shadows_.originals, shadows_.bounds, &shadows_.sunless);
  const auto sky_shadow = skyShadowOf(originals, frame_.params);
  shadows_.originals_sky = skyOver(*sky_shadow, whole, SquareMask());
  shadows_.originals_sky_levels = skyLevels(shadows_.originals_sky, *sky_shadow);
  shadows_.footprints = {};
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (frame_.edited[i] && !place_.footprints[i].empty())
      shadows_.footprints |= cv::boundingRect(place_.footprints[i]);
  }
}

// Where the originals darken what the others leave of the light.
void FrameCompositor::cacheShaded() {
  const cv::Size whole = frame_.input.bgr.size();
  cv::Mat originals_sky = shadows_.originals_sky_levels.clone();
  shadows_.shaded = cv::Mat::zeros(whole, CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < whole.height; ++v) {
    leaveHidden(v, 0, whole.width, originals_sky.ptr<std::uint8_t>(v));
    for (int u = 0; u < whole.width; ++u) {
      const std::uint8_t sun = levelAt(shadows_.originals_sun, u, v),
                         sky = originals_sky.at<std::uint8_t>(v, u);
      if ((sun == 255 && sky == 255) || !place_.takesShadow(u, v)) continue;
      shadows_.shaded.at<std::uint8_t>(v, u) = changeOfLight(darkeningAt(u, v, sun, sky));
    }
  }
  cv::dilate(shadows_.shaded, shadows_.shaded, disc(frame_.params.background.shadow_margin_px));
  shadows_.shaded_box = cv::boundingRect(shadows_.shaded);
}

// Part of its brightness that a pixel loses which gets these levels of sun and sky.
float FrameCompositor::darkeningAt(int u, int v, std::uint8_t sun, std::uint8_t sky) const {
  if (place_.view.relief().at(u, v))
    return (1.0f - place_.view.relief().umbra.at<float>(v, u)) * (1.0f - kPerLevel * sun);
  return 1.0f - luminance(shadowRatio(kPerLevel * sun, kPerLevel * sky));
}

// Where the sun's rays through the vertices pass through the box that the relief is in.
void FrameCompositor::addReliefBounds(const Points& vertices, const Eigen::Vector3f& sun,
                                      Points& shadow) const {
  const Relief& relief = place_.view.relief();
  if (relief.empty() || relief.box.isEmpty()) return;
  const Eigen::Array3f low = relief.box.min().array() - kReliefMargin,
                       high = relief.box.max().array() + kReliefMargin;
  const Eigen::Array3f way = -sun.array();
  for (const Eigen::Vector3f& p : vertices) {
    float enter = 0.0f, leave = 1e9f;
    for (int k = 0; k < 3; ++k) {
      const float slope = std::abs(way[k]) > 1e-6f ? way[k] : 1e-6f, a = (low[k] - p[k]) / slope,
                  b = (high[k] - p[k]) / slope;
      enter = std::max(enter, std::min(a, b)), leave = std::min(leave, std::max(a, b));
    }
    if (enter >= leave) continue;
    const float spread = static_cast<float>(frame_.params.sun_radius) * leave;
    const Eigen::Vector3f side = sun.unitOrthogonal(), other = sun.cross(side),
                          far = p - leave * sun;
    shadow.insert(shadow.end(), {p - enter * sun, far + spread * side, far - spread * side,
                                 far + spread * other, far - spread * other});
  }
}

// Adds the feet of the sun's rays through the vertices on a plane, with the disc's spread.
void FrameCompositor::addPlaneBounds(const SupportPlane& plane, const Points& vertices,
                                     const Eigen::Vector3f& sun, Points& shadow) const {
  const Eigen::Vector3f n = plane.normal.cast<float>();
  const float slope = n.dot(sun);
  if (slope < 0.02f) return;
  const Eigen::Vector3f side = n.unitOrthogonal(), other = n.cross(side);
  const Eigen::Vector3f nowhere =
      Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  const std::size_t first = shadow.size();
  shadow.resize(first + 4 * vertices.size(), nowhere);
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const float height = n.dot(vertices[i]) - static_cast<float>(plane.offset);
    if (height < -kHeightTolerance) continue;
    const float spread = frame_.params.sun_radius * height / (slope * slope);
    const Eigen::Vector3f foot = vertices[i] - sun * (height / slope);
    Eigen::Vector3f* to = &shadow[first + 4 * i];
    to[0] = foot + spread * side, to[1] = foot - spread * side, to[2] = foot + spread * other,
    to[3] = foot - spread * other;
  }
}

// Pixels onto which the sun can cast the vertices' shadow.
cv::Rect FrameCompositor::shadowBounds(const Points& vertices, const Light& light) const {
  Points shadow;
  for (const SupportPlane& plane : frame_.params.planes)
    addPlaneBounds(plane, vertices, light.direction, shadow);
  addReliefBounds(vertices, light.direction, shadow);
  return boundsOf(projectMesh(shadow, {}, frame_.input.camera), kShadowBoundsMargin,
                  frame_.input.bgr.size());
}

}  // namespace calipso::render
