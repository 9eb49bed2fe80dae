#include "triangle_map.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

namespace calipso::render {
namespace {

constexpr float kThinnest = 0.03f;  // px of height

// Coefficients of the sum of the corners' values, each weighted by its edge's function and its
// nearness.
void addCorner(float (&map)[3][4], const float (&edge)[3], const cv::v_float32x4& value) {
  for (int k = 0; k < 3; ++k)
    cv::v_store(map[k], cv::v_load(map[k]) + cv::v_setall_f32(edge[k]) * value);
}

float areaOf(const Eigen::Vector3f (&p)[3]) {
  return (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) -
         (p[2].x() - p[0].x()) * (p[1].y() - p[0].y());
}

// @param keys, normals of the corners, four values each
// @return false if it is too thin
bool fill(const Eigen::Vector3f (&p)[3], const float* const (&keys)[3],
          const float* const (&normals)[3], TriangleMap& map) {
  const float area = areaOf(p);
  const float longest =
      std::max({(p[1] - p[0]).head<2>().squaredNorm(), (p[2] - p[1]).head<2>().squaredNorm(),
                (p[0] - p[2]).head<2>().squaredNorm()});
  map.u = p[0].x(), map.v = p[0].y();
  std::fill_n(&map.key[0][0], 12, 0.0f), std::fill_n(&map.normal[0][0], 12, 0.0f);
  if (!(area * area > kThinnest * kThinnest * longest)) return false;
  const float scale = 1.0f / (area * p[0].z());
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
    const float factor = p[i].z() * scale;
    const float edge[3] = {i == 0 ? area * factor : 0.0f, (a.y() - b.y()) * factor,
                           (b.x() - a.x()) * factor};
    addCorner(map.key, edge, cv::v_load(keys[i]));
    addCorner(map.normal, edge, cv::v_load(normals[i]));
  }
  return true;
}

std::uint8_t traitsOf(Appearance::Source source) {
  switch (source) {
    case Appearance::Source::kPicture:
      return TriangleMap::kPictured;
    case Appearance::Source::kTexture:
      return TriangleMap::kTextured;
    default:
      return TriangleMap::kPictured | TriangleMap::kTextured;
  }
}

// Is the triangle's far side seen?
bool isTurned(const Actor& actor, const Eigen::Vector3i& t, const Eigen::Vector3f& eye) {
  const Eigen::Vector3f &a = actor.vertices[t[0]], &b = actor.vertices[t[1]],
                        &c = actor.vertices[t[2]];
  return (b - a).cross(c - a).dot(eye - a) < 0.0f;
}

}  // namespace

SurfaceMaps::SurfaceMaps(const Actor& actor, const Appearance& appearance,
                         const Eigen::Vector3f& eye)
    : actor_(&actor),
      corner_(appearance.region.tl()),
      vertices_(actor.vertices.size()),
      triangles_(new TriangleMap[actor.surface->triangles.size()]) {
  const Triangles& triangles = actor.surface->triangles;
  const Camera& c = appearance.key_camera;
  const Eigen::Isometry3f camera_from_world = c.world_from_camera.inverse().cast<float>();
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const Eigen::Vector3f q = camera_from_world * actor.surface->key_vertices[i],
                            sight = actor.vertices[i] - eye, &n = actor.normals[i];
      vertices_[i] = {
          {sight.x(), sight.y(), sight.z(), 0.0f},
          {n.x(), n.y(), n.z(), actor.surface->sky[i]},
          {static_cast<float>(c.fx) * q.x() + static_cast<float>(c.cx) * q.z(),
           static_cast<float>(c.fy) * q.y() + static_cast<float>(c.cy) * q.z(), q.z(), 1.0f}};
    }
#pragma omp for schedule(static, 64)
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      const Eigen::Vector3i& corners = triangles[t];
      Eigen::Vector3f p[3];
      for (int i = 0; i < 3; ++i) p[i] = actor.screen.points[corners[i]];
      triangles_[t].traits = TriangleMap::kThin;
      if (actor.screen.hides(areaOf(p))) continue;
      const Vertex &a = vertices_[corners[0]], &b = vertices_[corners[1]],
                   &d = vertices_[corners[2]];
      triangles_[t].traits = traitsOf(appearance.sources[t]);
      if (!fill(p, {a.key, b.key, d.key}, {a.normal, b.normal, d.normal}, triangles_[t]))
        triangles_[t].traits |= TriangleMap::kThin;
      if (isTurned(actor, corners, eye)) triangles_[t].traits |= TriangleMap::kTurned;
    }
  }
}

void SurfaceMaps::locate(const SurfacePlace* places, int count, SurfaceRun& run,
                         Eigen::Vector3f* weights) const {
  for (int k = 0; k < count; ++k) {
    const int triangle = VisibilityBuffer::triangleOf(places[k].id);
    const Eigen::Vector3i& t = actor_->surface->triangles[triangle];
    const Eigen::Vector3f w = barycentric(actor_->screen, triangle, places[k].u, places[k].v);
    weights[k] = w;
    const Vertex &a = vertices_[t[0]], &b = vertices_[t[1]], &c = vertices_[t[2]];
    const auto mix = [&](const float* x, const float* y, const float* z) {
      return cv::v_setall_f32(w[0]) * cv::v_load(x) + cv::v_setall_f32(w[1]) * cv::v_load(y) +
             cv::v_setall_f32(w[2]) * cv::v_load(z);
    };
    float sight[4], normal[4], key[4];
    cv::v_store(sight, mix(a.sight, b.sight, c.sight)),
        cv::v_store(normal, mix(a.normal, b.normal, c.normal)),
        cv::v_store(key, mix(a.key, b.key, c.key));
    const Eigen::Map<const Eigen::Vector3f> n(normal), s(sight);
    const float length = n.norm(),
                away = n.dot(s) > 0.0f && triangles_[triangle].is(TriangleMap::kTurned) ? -1 : 1,
                scale = length > 0.0f ? away / length : 0.0f;
    for (int i = 0; i < 3; ++i) run.sight[i][k] = s[i], run.normal[i][k] = n[i] * scale;
    run.sky[k] = normal[3];
    run.key_u[k] = key[0] / key[2] - static_cast<float>(corner_.x);
    run.key_v[k] = key[1] / key[2] - static_cast<float>(corner_.y);
  }
}

}  // namespace calipso::render
