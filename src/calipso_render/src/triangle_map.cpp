#include "triangle_map.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

constexpr float kThinnest = 0.03f;  // px of height

// Coefficients of the sum of the corners' values, each weighted by its edge's function and its
// nearness.
void addCorner(float (&map)[3][4], const float (&edge)[3], const Eigen::Vector4f& value) {
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < 4; ++c) map[k][c] += edge[k] * value[c];
  }
}

float areaOf(const Eigen::Vector3f (&p)[3]) {
  return (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) -
         (p[2].x() - p[0].x()) * (p[1].y() - p[0].y());
}

void fill(const Eigen::Vector3f (&p)[3], const Eigen::Vector3f (&key)[3], TriangleMap& map) {
  const float area = areaOf(p);
  const float longest = std::max({(p[1] - p[0]).head<2>().norm(), (p[2] - p[1]).head<2>().norm(),
                                  (p[0] - p[2]).head<2>().norm()});
  map.thin = !(std::abs(area) > kThinnest * longest);
  if (map.thin) return;
  map.u = p[0].x(), map.v = p[0].y();
  const float scale = 1.0f / (area * p[0].z());
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
    const float factor = p[i].z() * scale;
    const float edge[3] = {i == 0 ? area * factor : 0.0f, (a.y() - b.y()) * factor,
                           (b.x() - a.x()) * factor};
    addCorner(map.key, edge, {key[i].x(), key[i].y(), key[i].z(), 0.0f});
    addCorner(map.weights, edge, Eigen::Vector4f::Unit(i));
  }
}

}  // namespace

Eigen::Vector2f TriangleMap::keyAt(float pixel_u, float pixel_v) const {
  const float du = pixel_u - u, dv = pixel_v - v;
  const auto at = [&](int c) { return key[0][c] + key[1][c] * du + key[2][c] * dv; };
  return Eigen::Vector2f(at(0), at(1)) / at(2);
}

Eigen::Vector3f TriangleMap::weightsAt(float pixel_u, float pixel_v) const {
  const float du = pixel_u - u, dv = pixel_v - v;
  Eigen::Vector3f w;
  for (int c = 0; c < 3; ++c)
    w[c] = std::max(0.0f, weights[0][c] + weights[1][c] * du + weights[2][c] * dv);
  return w / w.sum();
}

std::vector<TriangleMap> triangleMaps(const Actor& actor, const Appearance& appearance) {
  const Triangles& triangles = actor.surface->triangles;
  const Eigen::Isometry3f camera_from_world =
      appearance.key_camera.world_from_camera.inverse().cast<float>();
  const Camera& c = appearance.key_camera;
  Points key(actor.vertices.size());
  std::vector<TriangleMap> maps(triangles.size());
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < key.size(); ++i) {
      const Eigen::Vector3f q = camera_from_world * actor.surface->key_vertices[i];
      key[i] = {static_cast<float>(c.fx) * q.x() + static_cast<float>(c.cx) * q.z(),
                static_cast<float>(c.fy) * q.y() + static_cast<float>(c.cy) * q.z(), q.z()};
    }
#pragma omp for schedule(static)
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      Eigen::Vector3f p[3], k[3];
      for (int i = 0; i < 3; ++i)
        p[i] = actor.screen.points[triangles[t][i]], k[i] = key[triangles[t][i]];
      if (!actor.screen.hides(areaOf(p))) fill(p, k, maps[t]);
    }
  }
  return maps;
}

}  // namespace calipso::render
