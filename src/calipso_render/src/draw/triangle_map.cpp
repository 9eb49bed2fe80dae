#include "draw/triangle_map.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

namespace calipso::render {
namespace {

constexpr float kThinnest = 0.03f;  // px of height
constexpr float kAway = -0.2f;      // cosine to the eye

// Coefficients of the sum of the corners' values, each weighted by its edge's function and its
// nearness; the weights add up to the nearness.
void addCorner(float (&map)[3][4], const float (&edge)[3], const cv::v_float32x4& value) {
  for (int k = 0; k < 3; ++k)
    cv::v_store(map[k], cv::v_load(map[k]) + cv::v_setall_f32(edge[k]) * value);
}

float areaOf(const Eigen::Vector3f (&p)[3]) {
  return (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) -
         (p[2].x() - p[0].x()) * (p[1].y() - p[0].y());
}

// What a corner of a triangle has, four values each.
struct Corner {
  const float *key, *normal, *sky, *ambient;
};

// @return false if it is too thin
bool fill(const Eigen::Vector3f (&p)[3], const Corner (&corners)[3], TriangleMap& map) {
  const float area = areaOf(p);
  const float longest =
      std::max({(p[1] - p[0]).head<2>().squaredNorm(), (p[2] - p[1]).head<2>().squaredNorm(),
                (p[0] - p[2]).head<2>().squaredNorm()});
  map.u = p[0].x(), map.v = p[0].y();
  std::fill_n(&map.key[0][0], 12, 0.0f), std::fill_n(&map.normal[0][0], 12, 0.0f),
      std::fill_n(&map.ambient[0][0], 12, 0.0f);
  if (!(area * area > kThinnest * kThinnest * longest)) return false;
  const float scale = 1.0f / area;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
    const float factor = p[i].z() * scale;
    const float edge[3] = {i == 0 ? area * factor : 0.0f, (a.y() - b.y()) * factor,
                           (b.x() - a.x()) * factor};
    const Corner& corner = corners[i];
    addCorner(map.key, edge, cv::v_load(corner.key));
    addCorner(map.normal, edge, cv::v_load(corner.normal) + cv::v_load(corner.sky));
    addCorner(map.ambient, edge, cv::v_load(corner.ambient));
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

SurfaceMaps::SurfaceMaps(const Actor& actor, const Appearance& appearance, const Light& light,
                         const ShadedGround& ground, const Eigen::Vector3f& eye)
    : actor_(&actor),
      corner_(appearance.region.tl()),
      vertices_(actor.normals.size()),
      triangles_(new TriangleMap[actor.surface->triangles.size()]) {
  around_.resize(actor.seen.size()), around_behind_.resize(actor.seen_behind.size());
  const Camera& c = appearance.key_camera;
  const Eigen::Isometry3f camera_from_world = c.world_from_camera.inverse().cast<float>();
#pragma omp parallel
  {
#pragma omp for schedule(static, 64)
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const int vertex = actor.surface->vertex_of_normal[i];
      const Eigen::Vector3f q = camera_from_world * actor.surface->key_vertices[vertex],
                            &at = actor.vertices[vertex], sight = at - eye, &n = actor.normals[i];
      vertices_[i] = {
          {sight.x(), sight.y(), sight.z(), 0.0f},
          {n.x(), n.y(), n.z(), 0.0f},
          {static_cast<float>(c.fx) * q.x() + static_cast<float>(c.cx) * q.z(),
           static_cast<float>(c.fy) * q.y() + static_cast<float>(c.cy) * q.z(), q.z(), 1.0f}};
      const auto around = [&](const SkySeen& seen, const Eigen::Vector3f& normal) -> Around {
        const cv::Vec3f ambient = ambientOn(light, seen, appearance.thrown_back);
        const Eigen::Vector3f view = -sight.normalized(), mirrored = mirroredIn(normal, view);
        // A vertex that faces away by little has triangles that are seen.
        const float lit = normal.dot(view) > kAway ? ground.lit(at, mirrored) : 1.0f;
        return {{ambient[0], ambient[1], ambient[2], 0.0f},
                {0.0f, 0.0f, 0.0f, skyMirrored(seen, mirrored, lit)}};
      };
      around_[i] = around(actor.seen[i], n);
      if (!around_behind_.empty()) around_behind_[i] = around(actor.seen_behind[i], -n);
    }
#pragma omp for schedule(static, 64)
    for (std::size_t t = 0; t < actor.surface->triangles.size(); ++t)
      fillTriangle(t, appearance, eye);
  }
}

void SurfaceMaps::fillTriangle(std::size_t t, const Appearance& appearance,
                               const Eigen::Vector3f& eye) {
  const Eigen::Vector3i& corners = actor_->surface->triangles[t];
  TriangleMap& map = triangles_[t];
  Eigen::Vector3f p[3];
  for (int i = 0; i < 3; ++i) p[i] = actor_->screen.points[corners[i]];
  map.traits = TriangleMap::kThin;
  if (actor_->screen.hides(areaOf(p))) return;
  map.traits = traitsOf(appearance.sources[t]);
  if (isTurned(*actor_, corners, eye)) map.traits |= TriangleMap::kTurned;
  const std::vector<Around>& around = aroundOf(static_cast<int>(t));
  const auto corner = [&](int i) -> Corner {
    const int number = actor_->surface->corners[t][i];
    const Vertex& x = vertices_[number];
    return {x.key, x.normal, around[number].sky, around[number].light};
  };
  if (!fill(p, {corner(0), corner(1), corner(2)}, map)) map.traits |= TriangleMap::kThin;
}

void SurfaceMaps::locate(const SurfacePlace* places, int count, SurfaceRun& run,
                         Eigen::Vector3f* weights) const {
  for (int k = 0; k < count; ++k) {
    const int triangle = VisibilityBuffer::triangleOf(places[k].id);
    const Eigen::Vector3i& t = actor_->surface->corners[triangle];
    const Eigen::Vector3f w = barycentric(actor_->screen, triangle, places[k].u, places[k].v);
    weights[k] = w;
    const Vertex &a = vertices_[t[0]], &b = vertices_[t[1]], &c = vertices_[t[2]];
    const auto mix = [&](const float* x, const float* y, const float* z) {
      return cv::v_setall_f32(w[0]) * cv::v_load(x) + cv::v_setall_f32(w[1]) * cv::v_load(y) +
             cv::v_setall_f32(w[2]) * cv::v_load(z);
    };
    const std::vector<Around>& around = aroundOf(triangle);
    const Around &d = around[t[0]], &e = around[t[1]], &f = around[t[2]];
    float sight[4], normal[4], key[4], ambient[4];
    cv::v_store(sight, mix(a.sight, b.sight, c.sight)),
        cv::v_store(normal, mix(a.normal, b.normal, c.normal)),
        cv::v_store(key, mix(a.key, b.key, c.key)),
        cv::v_store(ambient, mix(d.light, e.light, f.light));
    const Eigen::Map<const Eigen::Vector3f> n(normal), s(sight);
    const float length = n.norm(),
                away = n.dot(s) > 0.0f && triangles_[triangle].is(TriangleMap::kTurned) ? -1 : 1,
                scale = length > 0.0f ? away / length : 0.0f;
    for (int i = 0; i < 3; ++i) run.sight[i][k] = s[i], run.normal[i][k] = n[i] * scale;
    for (int i = 0; i < 3; ++i) run.ambient[i][k] = ambient[i];
    run.sky[k] = w[0] * d.sky[3] + w[1] * e.sky[3] + w[2] * f.sky[3];
    run.key_u[k] = key[0] / key[2] - static_cast<float>(corner_.x);
    run.key_v[k] = key[1] / key[2] - static_cast<float>(corner_.y);
  }
}

}  // namespace calipso::render
