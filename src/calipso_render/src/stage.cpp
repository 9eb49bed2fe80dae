#include "calipso_render/stage.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include "draw/side_by_side.hpp"
#include "light/sky_seen.hpp"
#include "place/view_warp.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {

namespace {

// Area-weighted sums of the triangles' normals over their corners, unit length.
// @param corners per triangle: which of the `count` sums its corners add to
Points normalsOver(const Points& vertices, const Triangles& triangles, const Triangles& corners,
                   std::size_t count) {
  Points normals(count, Eigen::Vector3f::Zero());
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const Eigen::Vector3i& t = triangles[k];
    const Eigen::Vector3f n =
        (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
    for (int i = 0; i < 3; ++i) normals[corners[k][i]] += n;
  }
  for (Eigen::Vector3f& n : normals) {
    const float length = n.norm();
    if (length > 0.0f) n /= length;
  }
  return normals;
}

}  // namespace

Points vertexNormals(const Points& vertices, const Triangles& triangles) {
  return normalsOver(vertices, triangles, triangles, vertices.size());
}

Points surfaceNormals(const Surface& surface, const Points& vertices) {
  return normalsOver(vertices, surface.triangles, surface.corners, surface.vertex_of_normal.size());
}

Points transformed(const Points& points, const Eigen::Isometry3d& transform) {
  Points out(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    out[i] = (transform * points[i].cast<double>()).cast<float>();
  return out;
}

namespace {

Eigen::Vector3d meanOf(const Points& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : points) sum += p.cast<double>();
  return sum / static_cast<double>(points.size());
}

// The turn that takes one set of points best to another (Kabsch 1976).
Eigen::Matrix3f turnBetween(const Points& from, const Points& to) {
  if (from == to) return Eigen::Matrix3f::Identity();
  const Eigen::Vector3d from_mean = meanOf(from), to_mean = meanOf(to);
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i)
    products += (to[i].cast<double>() - to_mean) * (from[i].cast<double>() - from_mean).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(products, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV();
  const double side = (U * V.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return (U * Eigen::Vector3d(1.0, 1.0, side).asDiagonal() * V.transpose()).cast<float>();
}

// Surface::stock_vertices.
Points stockAt(const ObjectModel& model, const Points& key_vertices) {
  if (model.stock.vertexCount() != static_cast<int>(key_vertices.size())) return key_vertices;
  Points stock;
  for (int i = 0; i < model.stock.vertexCount(); ++i)
    stock.push_back(model.stock.vertex(i).cast<float>());
  const Eigen::Matrix3f turn = turnBetween(stock, key_vertices);
  const Eigen::Vector3f from = meanOf(stock).cast<float>(), to = meanOf(key_vertices).cast<float>();
  for (Eigen::Vector3f& p : stock) p = to + turn * (p - from);
  return stock;
}

// Triangles with vertices of their own, as some files have them, are neighbours where these are at
// one place. Faces that a sheet has twice, once for each side, stay as they are.
void joinCorners(const Points& vertices, Triangles& triangles) {
  const std::vector<int> welded = weld(vertices);
  const auto cornersOf = [&](const Eigen::Vector3i& t) {
    std::array<int, 3> face = {welded[t[0]], welded[t[1]], welded[t[2]]};
    std::sort(face.begin(), face.end());
    return face;
  };
  std::map<std::array<int, 3>, int> times;
  for (const Eigen::Vector3i& t : triangles) ++times[cornersOf(t)];
  for (Eigen::Vector3i& t : triangles) {
    const std::array<int, 3> face = cornersOf(t);
    const bool no_area = face[0] == face[1] || face[1] == face[2];
    if (!no_area && times[face] == 1) t = {welded[t[0]], welded[t[1]], welded[t[2]]};
  }
}

}  // namespace

void findNormals(Surface& surface) {
  surface.edges = meshEdges(surface.triangles);
  MeshNormals normals = meshNormals(surface.key_vertices, surface.triangles, surface.edges);
  surface.corners = std::move(normals.corners);
  surface.vertex_of_normal = std::move(normals.vertex_of);
  surface.key_normals = surfaceNormals(surface, surface.key_vertices);
  Points places;  // of the normals
  for (const int vertex : surface.vertex_of_normal) places.push_back(surface.key_vertices[vertex]);
  findSkySeen(places, surface.key_normals, surface.corners, surface.winding != 1, surface.seen,
              surface.seen_behind);
}

std::vector<bool> shownAnew(const std::vector<View>& views, const std::vector<bool>& moves) {
  const bool camera_moves = std::any_of(views.begin(), views.end(), [&](const View& v) {
    return !sameView(v.camera, views.front().camera);
  });
  return camera_moves ? std::vector<bool>(moves.size(), true) : moves;
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
  joinCorners(surface.object_vertices, surface.triangles);
  surface.winding = outsideWinding(surface.object_vertices, surface.triangles);
  surface.key_vertices = transformed(surface.object_vertices, model.world_from_object);
  surface.stock_vertices = stockAt(model, surface.key_vertices);
  findNormals(surface);
  return surface;
}

namespace {

// What the surface sees, turned with their object and then as their normals are beside it.
// @param turn of the object
void turnSeen(const Surface& surface, const Eigen::Matrix3f& turn, Actor& actor) {
  actor.seen.resize(surface.seen.size()), actor.seen_behind.resize(surface.seen_behind.size());
  constexpr float kSame = 0.9998f;  // cosine: about a degree
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < actor.seen.size(); ++i) {
    const Eigen::Vector3f n = turn * surface.key_normals[i];
    Eigen::Matrix3f by = turn;
    if (n.dot(actor.normals[i]) < kSame)
      by = Eigen::Quaternionf::FromTwoVectors(n, actor.normals[i]).toRotationMatrix() * turn;
    actor.seen[i] = surface.seen[i].turned(by);
    if (!actor.seen_behind.empty()) actor.seen_behind[i] = surface.seen_behind[i].turned(by);
  }
}

}  // namespace

Actor makeActor(const Surface& surface, Points vertices, const Camera& camera) {
  Actor actor;
  actor.surface = &surface;
  actor.vertices = std::move(vertices);
  const bool fits = actor.vertices.size() == surface.key_vertices.size();
  Eigen::Matrix3f turn;
  sideBySide(
      true,
      [&] {
        if (fits) actor.normals = surfaceNormals(surface, actor.vertices);
      },
      [&] {
        actor.screen = projectMesh(actor.vertices, surface.triangles, camera);
        if (fits) turn = turnBetween(surface.key_vertices, actor.vertices);
      });
  if (fits) turnSeen(surface, turn, actor);
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

std::vector<Occluder> occludersOf(const std::vector<Actor>& actors) {
  std::vector<Occluder> all;
  for (const Actor& a : actors)
    all.push_back({&a.vertices, &a.surface->triangles, a.surface->winding});
  return all;
}

SurfacePoint surfacePoint(const Actor& actor, int triangle, float u, float v,
                          const Eigen::Vector3f& eye) {
  return surfacePoint(actor, triangle, barycentric(actor.screen, triangle, u, v), eye);
}

SurfacePoint surfacePoint(const Actor& actor, int triangle, const Eigen::Vector3f& w,
                          const Eigen::Vector3f& eye) {
  const Eigen::Vector3i &t = actor.surface->triangles[triangle],
                        &c = actor.surface->corners[triangle];
  const Eigen::Vector3f position = mix(actor.vertices, t, w),
                        normal = unit(mix(actor.normals, c, w));
  const float side = seenFromBehind(actor, t, position, normal, eye) ? -1.0f : 1.0f;
  const std::vector<SkySeen>& seen =
      side < 0.0f && !actor.seen_behind.empty() ? actor.seen_behind : actor.seen;
  return {position,
          side * normal,
          mix(actor.surface->key_vertices, t, w),
          side * unit(mix(actor.surface->key_normals, c, w)),
          seen[c[0]] * w[0] + seen[c[1]] * w[1] + seen[c[2]] * w[2],
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
