#include "calipso_render/stage.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "mesh_topology.hpp"
#include "ray_scene.hpp"

namespace calipso::render {

Points vertexNormals(const Points& vertices, const Triangles& triangles) {
  Points normals(vertices.size(), Eigen::Vector3f::Zero());
  for (const Eigen::Vector3i& t : triangles) {
    const Eigen::Vector3f n =
        (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
    for (int i = 0; i < 3; ++i) normals[t[i]] += n;
  }
  for (Eigen::Vector3f& n : normals) {
    const float length = n.norm();
    if (length > 0.0f) n /= length;
  }
  return normals;
}

Points transformed(const Points& points, const Eigen::Isometry3d& transform) {
  Points out(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    out[i] = (transform * points[i].cast<double>()).cast<float>();
  return out;
}

Surface makeSurface(const ObjectModel& model) {
  if (model.mesh.triangleCount() == 0) {
    throw std::invalid_argument("object '" + model.name +
                                "': its mesh has no triangles, nothing can be drawn");
  }
  if (!model.mesh.vertices.allFinite()) {
    throw std::invalid_argument("object '" + model.name +
                                "': its mesh has vertices that are not finite");
  }
  Surface surface;
  surface.name = model.name;
  surface.index = model.index;
  for (int i = 0; i < model.mesh.vertexCount(); ++i)
    surface.object_vertices.push_back(model.mesh.vertex(i).cast<float>());
  for (int t = 0; t < model.mesh.triangleCount(); ++t) {
    const Eigen::Vector3i triangle = model.mesh.triangles.row(t);
    if (triangle.minCoeff() < 0 || triangle.maxCoeff() >= model.mesh.vertexCount()) {
      throw std::invalid_argument("object '" + model.name + "': triangle " + std::to_string(t) +
                                  " names a vertex outside 0.." +
                                  std::to_string(model.mesh.vertexCount() - 1));
    }
    surface.triangles.push_back(triangle);
  }
  surface.edges = meshEdges(surface.triangles);
  surface.winding = outsideWinding(surface.object_vertices, surface.triangles);
  surface.key_vertices = transformed(surface.object_vertices, model.world_from_object);
  surface.key_normals = vertexNormals(surface.key_vertices, surface.triangles);
  surface.sky = skyExposure(surface.key_vertices, surface.key_normals, surface.triangles);
  return surface;
}

Actor makeActor(const Surface& surface, Points vertices, const Camera& camera) {
  Actor actor;
  actor.surface = &surface;
  actor.vertices = std::move(vertices);
  actor.normals = vertexNormals(actor.vertices, surface.triangles);
  actor.screen = projectMesh(actor.vertices, surface.triangles, camera);
  const auto behind = [](const Eigen::Vector3f& p) { return std::isnan(p.z()); };
  const bool around_us =
      std::any_of(actor.screen.points.begin(), actor.screen.points.end(), behind);
  actor.screen.hidden_side = around_us ? 0 : surface.winding;
  return actor;
}

namespace {

Eigen::Vector3f mix(const Points& x, const Eigen::Vector3i& t, const Eigen::Vector3f& w) {
  return w[0] * x[t[0]] + w[1] * x[t[1]] + w[2] * x[t[2]];
}

Eigen::Vector3f unit(const Eigen::Vector3f& x) {
  const float squared = x.squaredNorm();
  return squared > 0.0f ? Eigen::Vector3f(x * (1.0f / std::sqrt(squared))) : x;
}

// Sheets are seen from both sides: has the one towards the viewer the other normal?
bool seenFromBehind(const Actor& actor, const Eigen::Vector3i& t, const Eigen::Vector3f& position,
                    const Eigen::Vector3f& normal, const Eigen::Vector3f& eye) {
  if (normal.dot(eye - position) >= 0.0f) return false;
  const Eigen::Vector3f &a = actor.vertices[t[0]], &b = actor.vertices[t[1]],
                        &c = actor.vertices[t[2]];
  return (b - a).cross(c - a).dot(eye - position) < 0.0f;
}

}  // namespace

SurfacePoint surfacePoint(const Actor& actor, int triangle, float u, float v,
                          const Eigen::Vector3f& eye) {
  return surfacePoint(actor, triangle, barycentric(actor.screen, triangle, u, v), eye);
}

SurfacePoint surfacePoint(const Actor& actor, int triangle, const Eigen::Vector3f& w,
                          const Eigen::Vector3f& eye) {
  const Eigen::Vector3i& t = actor.surface->triangles[triangle];
  const Eigen::Vector3f position = mix(actor.vertices, t, w),
                        normal = unit(mix(actor.normals, t, w));
  const std::vector<float>& sky = actor.surface->sky;
  const float side = seenFromBehind(actor, t, position, normal, eye) ? -1.0f : 1.0f;
  return {position,
          side * normal,
          mix(actor.surface->key_vertices, t, w),
          side * unit(mix(actor.surface->key_normals, t, w)),
          w[0] * sky[t[0]] + w[1] * sky[t[1]] + w[2] * sky[t[2]],
          triangle,
          w};
}

std::optional<Receiver> receiverAt(const std::vector<SupportPlane>& planes, const Camera& camera,
                                   float u, float v) {
  const Eigen::Vector3d eye = camera.world_from_camera.translation();
  const Eigen::Vector3d ray = camera.world_from_camera.linear() * camera.ray(u, v);
  std::optional<Receiver> nearest;
  double nearest_depth = 1e30;
  for (const SupportPlane& plane : planes) {
    const double slope = plane.normal.dot(ray);
    if (slope >= -1e-9) continue;  // seen from below, or never
    const double depth = (plane.offset - plane.normal.dot(eye)) / slope;
    const Eigen::Vector3d p = eye + depth * ray;
    if (depth <= 0.0 || depth >= nearest_depth) continue;
    if (plane.x_range && (p.x() < plane.x_range->x() || p.x() > plane.x_range->y())) continue;
    nearest_depth = depth;
    nearest = Receiver{p.cast<float>(), plane.normal.cast<float>()};
  }
  return nearest;
}

}  // namespace calipso::render
