#include "frame/occlusion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_render/ray_shadow.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "draw/joint_visibility.hpp"

namespace calipso::render {
namespace {

constexpr int kShadowMapSide = 512;     // texels, live
constexpr int kShadowBoundsMargin = 8;  // px
constexpr float kReliefMargin = 0.01f;  // m: planes have boxes without thickness
// of the height: a vertex that far below its plane still shades it
constexpr float kHeightTolerance = 0.02f;

// Where the sun's rays through the vertices pass through the box that the relief is in.
void addReliefBounds(const Relief& relief, float sun_radius, const Points& vertices,
                     const Eigen::Vector3f& sun, Points& shadow) {
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
    const float spread = sun_radius * leave;
    const Eigen::Vector3f side = sun.unitOrthogonal(), other = sun.cross(side),
                          far = p - leave * sun;
    shadow.insert(shadow.end(), {p - enter * sun, far + spread * side, far - spread * side,
                                 far + spread * other, far - spread * other});
  }
}

// Adds the feet of the sun's rays through the vertices on a plane, with the disc's spread.
void addPlaneBounds(const SupportPlane& plane, float sun_radius, const Points& vertices,
                    const Eigen::Vector3f& sun, Points& shadow) {
  const Eigen::Vector3f n = plane.normal.cast<float>();
  const float slope = n.dot(sun);
  if (slope < 0.02f) return;
  const Eigen::Vector3f side = n.unitOrthogonal(), other = n.cross(side);
  const Eigen::Vector3f nowhere =
      Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  const auto height_of = [&](const Eigen::Vector3f& p) {
    return n.dot(p) - static_cast<float>(plane.offset);
  };
  const auto sunk = [&](const Eigen::Vector3f& p) { return height_of(p) < -kHeightTolerance; };
  const auto count = std::count_if(vertices.begin(), vertices.end(), sunk);
  if (count == static_cast<std::ptrdiff_t>(vertices.size())) return;
  // Where edges pass through the plane lies between the feet of their ends' perpendiculars.
  for (std::size_t i = 0; count > 0 && i < vertices.size(); ++i)
    shadow.push_back(vertices[i] - n * height_of(vertices[i]));
  const std::size_t first = shadow.size();
  shadow.resize(first + 4 * vertices.size(), nowhere);
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const float height = height_of(vertices[i]);
    if (height < -kHeightTolerance) continue;
    const float spread = sun_radius * height / (slope * slope);
    const Eigen::Vector3f foot = vertices[i] - sun * (height / slope);
    Eigen::Vector3f* to = &shadow[first + 4 * i];
    to[0] = foot + spread * side, to[1] = foot - spread * side, to[2] = foot + spread * other,
    to[3] = foot - spread * other;
  }
}

// One map, or one for each group of occluders.
template <class MapOf>
std::unique_ptr<Visibility> mapsOf(const std::vector<Occluder>& occluders,
                                   const Eigen::Vector3d& direction, const MapOf& map_of) {
  const std::vector<std::vector<Occluder>> groups = nearGroups(occluders, direction);
  if (groups.size() <= 1) return map_of(occluders);
  std::vector<std::unique_ptr<Visibility>> maps;
  for (const std::vector<Occluder>& group : groups) maps.push_back(map_of(group));
  return std::make_unique<JointVisibility>(std::move(maps));
}

}  // namespace

std::unique_ptr<Visibility> skyVisibility(const std::vector<Occluder>& all,
                                          const RenderParams& params) {
  const std::vector<Occluder> occluders = params.planes.empty() ? std::vector<Occluder>{} : all;
  const Eigen::Vector3d up = params.planes.empty() ? params.up : params.planes.front().normal;
  if (params.quality == Quality::kFinal)
    return std::make_unique<RayShadow>(occluders, up, RayShadow::Params{kSkyRadius, 48});
  return mapsOf(occluders, up, [&](const std::vector<Occluder>& group) {
    return std::make_unique<SkyMap>(group, up, SkyMap::Params());
  });
}

ReliefSky skyOnWalls(const std::vector<Occluder>& occluders, const Relief& relief,
                     const RenderParams& params) {
  return {relief, occluders,
          params.quality == Quality::kFinal ? ReliefSky::kFine : SkyMap::Params().resolution};
}

std::unique_ptr<Visibility> sunVisibility(const std::vector<Occluder>& occluders,
                                          const Light& light, const RenderParams& params) {
  const Eigen::Vector3d direction = light.direction.cast<double>();
  if (params.quality == Quality::kFinal)
    return std::make_unique<RayShadow>(occluders, direction,
                                       RayShadow::Params{light.angular_radius, 24});
  return mapsOf(occluders, direction, [&](const std::vector<Occluder>& group) {
    return std::make_unique<ShadowMap>(group, direction,
                                       ShadowMap::Params{kShadowMapSide, light.angular_radius, 16});
  });
}

cv::Rect shadowBounds(const StagedFrame& frame, const Relief& relief, const Points& vertices,
                      const Eigen::Vector3f& sun) {
  Points shadow;
  for (const SupportPlane& plane : frame.params.planes)
    addPlaneBounds(plane, frame.light.angular_radius, vertices, sun, shadow);
  addReliefBounds(relief, frame.light.angular_radius, vertices, sun, shadow);
  const ScreenMesh seen = projectMesh(shadow, {}, frame.input.camera);
  // A shadow that goes on behind the camera can leave the picture anywhere.
  for (std::size_t i = 0; i < shadow.size(); ++i) {
    if (shadow[i].allFinite() && std::isnan(seen.points[i].z())) return frame.whole();
  }
  return boundsOf(seen, kShadowBoundsMargin, frame.input.bgr.size());
}

}  // namespace calipso::render
